// Bytes as a page can carry them: a zlib stream in base64.
#ifndef DCLOTH_TOOLS_BLOB_H_
#define DCLOTH_TOOLS_BLOB_H_

#include <cstddef>
#include <span>
#include <string>

namespace dcloth::tools {

std::string PackBlob(std::span<const std::byte> bytes);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_BLOB_H_
