// What the commands share that read what artists have.
#ifndef DCLOTH_TOOLS_IMPORT_IMPORT_H_
#define DCLOTH_TOOLS_IMPORT_IMPORT_H_

#include <filesystem>
#include <optional>

#include "tools/character/character_space.h"
#include "tools/cli.h"

namespace dcloth::tools {

// --unit and --up.
void AddSpaceOptions(CLI::App* command, SpaceOptions* options);

// Third-party readers may crash or never end on a damaged file: the work is done in a child process.
// On POSIX forks: returns nothing in the child, which goes on with the command under limits of memory and time, and its
// exit code in the parent. Throws converter::Error when there is no second process to be had and, in the parent, when a
// signal ended the child. Elsewhere returns nothing and guards nothing.
std::optional<int> InChild(const std::filesystem::path& input);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_IMPORT_IMPORT_H_
