// Axes and unit of a file: what it says, what the user says, and whether a character of that size can be.
#ifndef DCLOTH_TOOLS_IMPORT_SPACE_OPTIONS_H_
#define DCLOTH_TOOLS_IMPORT_SPACE_OPTIONS_H_

#include "tools/cli.h"
#include <span>
#include <string>

#include "tools/import/character_pose.h"

namespace dcloth::tools {

struct SpaceOptions {
  std::string unit;  // m, cm, mm, in, ft or metres in a unit; empty: as the file says, metres where it does not
  std::string up;    // y or z; empty: as the file says, y where it does not
};

void AddSpaceOptions(CLI::App* command, SpaceOptions* options);

// Throws converter::Error where the joints at rest span less than 0.1 m or more than 10 m and no unit was given.
CharacterSpace SpaceOf(const CharacterFile& file, const SpaceOptions& options,
                       std::span<const Eigen::Matrix4d> rest_joints);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_IMPORT_SPACE_OPTIONS_H_
