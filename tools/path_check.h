// No command writes over what it reads, nor two of its outputs into one file.
#ifndef DCLOTH_TOOLS_PATH_CHECK_H_
#define DCLOTH_TOOLS_PATH_CHECK_H_

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace dcloth::tools {

// Whether two names mean one file: links, other spellings, and files that are not there yet.
bool IsSameFile(const std::filesystem::path& a, const std::filesystem::path& b);

// The files of a command. Empty paths, of options that were not given, are passed over.
class CommandFiles {
 public:
  // `what` names it in messages: "the bundle".
  void Reads(std::string what, const std::filesystem::path& path);
  void Reads(const std::string& what, std::span<const std::filesystem::path> paths);
  // `option` names it in messages: "--report".
  void Writes(std::string option, const std::filesystem::path& path);

  // Throws converter::Error; before anything is read, since reading may take long.
  void Check() const;

 private:
  struct Named {
    std::string name;
    std::filesystem::path path;
  };
  std::vector<Named> inputs_, outputs_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PATH_CHECK_H_
