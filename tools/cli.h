// The command line's parser, with file names in UTF-8 on every system.
#ifndef DCLOTH_TOOLS_CLI_H_
#define DCLOTH_TOOLS_CLI_H_

#include <filesystem>
#include <string>

namespace CLI::detail {

// The parser would leave it to path's constructor, which on Windows takes text for the C library's character set.
// Declared before the parser's templates, which find it there.
inline bool lexical_cast(const std::string& input, std::filesystem::path& output) {
  output = std::u8string(input.begin(), input.end());
  return true;
}

}  // namespace CLI::detail

#include <CLI/CLI.hpp>

#endif  // DCLOTH_TOOLS_CLI_H_
