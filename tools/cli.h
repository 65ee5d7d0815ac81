// The command line's parser, with file names in UTF-8 on every system, and its checks.
#ifndef DCLOTH_TOOLS_CLI_H_
#define DCLOTH_TOOLS_CLI_H_

#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace CLI::detail {

// The parser would leave it to path's constructor, which on Windows takes text for the C library's character set.
// Declared before the parser's templates, which find it there.
inline bool lexical_cast(const std::string& input, std::filesystem::path& output) {
  output = std::u8string(input.begin(), input.end());
  return true;
}

}  // namespace CLI::detail

#include <CLI/CLI.hpp>

namespace dcloth::tools {

// Numbers from `low` to `high`. CLI11's Range and PositiveNumber let NaN through, and a bound of NaN is never missed.
CLI::Validator NumberWithin(double low, double high);

// Numbers above 0, finite.
CLI::Validator NumberAboveZero();

// Whether two names mean one file: links, other spellings, and files that are not there yet.
bool IsSameFile(const std::filesystem::path& a, const std::filesystem::path& b);

// The files of a command: none writes over what it reads, nor two of its outputs into one file. Empty paths, of options
// that were not given, are passed over.
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

#endif  // DCLOTH_TOOLS_CLI_H_
