// Files of other programs that are passed where ours are wanted, by their first bytes.
#ifndef DCLOTH_CONVERTER_FOREIGN_FILE_H_
#define DCLOTH_CONVERTER_FOREIGN_FILE_H_

#include <cstddef>
#include <span>

namespace dcloth::converter {

struct ForeignFile {
  const char* name;  // "a Git LFS pointer"; null where the bytes tell nothing
  const char* mend;
};

// For bytes that are no file of ours: none of these is a sound safetensors file or model.
ForeignFile ForeignFileOf(std::span<const std::byte> bytes);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_FOREIGN_FILE_H_
