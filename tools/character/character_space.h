// Axes and unit of a file: what it says, what the user says, and whether a character of that size can be.
#ifndef DCLOTH_TOOLS_CHARACTER_CHARACTER_SPACE_H_
#define DCLOTH_TOOLS_CHARACTER_CHARACTER_SPACE_H_

#include <span>
#include <string>

#include "tools/character/character.h"

namespace dcloth::tools {

struct SpaceOptions {
  std::string unit;  // m, cm, mm, in, ft or metres in a unit; empty: as the file says, metres where it does not
  std::string up;    // y or z; empty: as the file says, y where it does not
};

// The file's axes and unit to metres, +Y up, +Z front.
struct CharacterSpace {
  Eigen::Matrix3d upright = Eigen::Matrix3d::Identity();
  double metres_per_unit = 1;

  // A node's matrix in the file's world: axes turned and positions scaled; a joint's own frame keeps its handedness and
  // the scale of its axes.
  Eigen::Matrix4d World(const Eigen::Matrix4d& matrix) const;
  Eigen::Vector3d Point(const Eigen::Vector3d& point) const { return metres_per_unit * (upright * point); }
};

// Throws converter::Error where the joints at rest span less than 0.1 m or more than 10 m and no unit was given.
CharacterSpace SpaceOf(const CharacterFile& file, const SpaceOptions& options,
                       std::span<const Eigen::Matrix4d> rest_joints);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_CHARACTER_SPACE_H_
