// Where a character's nodes are at a time of a clip.
#ifndef DCLOTH_TOOLS_IMPORT_CHARACTER_POSE_H_
#define DCLOTH_TOOLS_IMPORT_CHARACTER_POSE_H_

#include <vector>

#include "tools/import/character.h"

namespace dcloth::tools {

// The file's axes and unit to metres, +Y up, +Z front.
struct CharacterSpace {
  Eigen::Matrix3d upright = Eigen::Matrix3d::Identity();
  double metres_per_unit = 1;

  // A node's matrix in the file's world: axes turned and positions scaled; a joint's own frame keeps its handedness and
  // the scale of its axes.
  Eigen::Matrix4d World(const Eigen::Matrix4d& matrix) const;
  Eigen::Vector3d Point(const Eigen::Vector3d& point) const { return metres_per_unit * (upright * point); }
};

// Every node to the file's world, [nodes]; `clip` may be null: the pose without animation. Between keys rotations turn
// on the arc, positions and scales go straight; beyond the first and last key they hold.
std::vector<Eigen::Matrix4d> WorldMatrices(const CharacterFile& file, const CharacterClip* clip, double seconds);

// The pose the skin was bound in where there is a skin, otherwise the pose without animation; [nodes], file's world.
std::vector<Eigen::Matrix4d> RestMatrices(const CharacterFile& file);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_IMPORT_CHARACTER_POSE_H_
