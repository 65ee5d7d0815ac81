// --unit and --up.
#ifndef DCLOTH_TOOLS_IMPORT_SPACE_OPTIONS_H_
#define DCLOTH_TOOLS_IMPORT_SPACE_OPTIONS_H_

#include "tools/character/character_space.h"
#include "tools/cli.h"

namespace dcloth::tools {

void AddSpaceOptions(CLI::App* command, SpaceOptions* options);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_IMPORT_SPACE_OPTIONS_H_
