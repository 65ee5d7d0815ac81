// The commands that read what artists have; as in tools/commands.h.
#ifndef DCLOTH_TOOLS_IMPORT_COMMANDS_H_
#define DCLOTH_TOOLS_IMPORT_COMMANDS_H_

#include "tools/commands.h"

namespace dcloth::tools {

void AddPoses(CLI::App& app, int& exit_code);
void AddBody(CLI::App& app, int& exit_code);
void AddHero(CLI::App& app, int& exit_code);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_IMPORT_COMMANDS_H_
