// What the command line says after the program's name, in UTF-8 on every system.
#ifndef DCLOTH_TOOLS_ARGUMENTS_H_
#define DCLOTH_TOOLS_ARGUMENTS_H_

#include <string>
#include <vector>

namespace dcloth::tools {

// Windows hands main text in its old character set, with '?' for what that lacks; there the system is asked instead.
// Throws std::runtime_error where it does not tell.
std::vector<std::string> Utf8Arguments(int argc, char** argv);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_ARGUMENTS_H_
