// What assimp may open: regular files of bounded size in one folder. Each adds to the memory it may take.
#ifndef DCLOTH_TOOLS_CHARACTER_FILE_SYSTEM_H_
#define DCLOTH_TOOLS_CHARACTER_FILE_SYSTEM_H_

#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <filesystem>
#include <set>

#include "tools/character/memory_limit.h"

namespace dcloth::tools {

class FolderFileSystem : public Assimp::IOSystem {
 public:
  FolderFileSystem(const std::filesystem::path& folder, MemoryLimit* limit);  // outlives it

  bool Exists(const char* file) const override;
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override;  // null where not allowed
  void Close(Assimp::IOStream* stream) override;

 private:
  bool Inside(const std::filesystem::path& file) const;

  std::filesystem::path folder_;
  MemoryLimit* limit_;
  std::set<std::filesystem::path> opened_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_FILE_SYSTEM_H_
