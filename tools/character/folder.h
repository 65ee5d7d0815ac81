// What a file may open beside itself: regular files of bounded size in its own folder. Each adds to the memory that
// reading may take.
#ifndef DCLOTH_TOOLS_CHARACTER_FOLDER_H_
#define DCLOTH_TOOLS_CHARACTER_FOLDER_H_

#include <filesystem>
#include <optional>
#include <set>

#include "converter/file.h"
#include "tools/character/memory_limit.h"

namespace dcloth::tools {

class Folder {
 public:
  Folder(const std::filesystem::path& folder, MemoryLimit* limit);  // outlives it

  bool Has(const std::filesystem::path& file) const;
  std::optional<converter::AlignedBytes> Read(const std::filesystem::path& file,
                                              uint64_t most_bytes = uint64_t{1} << 30);

 private:
  std::filesystem::path folder_;
  MemoryLimit* limit_;
  std::set<std::filesystem::path> opened_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_FOLDER_H_
