// Poses in double, and what hosts do to them: turn, move, exaggerate, deform.
#ifndef DCLOTH_TESTS_STABILITY_MOTION_H_
#define DCLOTH_TESTS_STABILITY_MOTION_H_

#include <Eigen/Core>
#include <cstddef>
#include <vector>

namespace dcloth::stability {

using Matrix = Eigen::Matrix4d;
using Pose = std::vector<Matrix>;  // joint to world, metres
using Motion = std::vector<Pose>;  // one pose a tick

// What the transforms below need to know of a character.
struct Rig {
  size_t hips = 0;
  std::vector<Matrix> bind;     // joint to world
  std::vector<size_t> parents;  // of each joint; the hips' own index for the hips
};

// A bundle names joints but no tree. A child's origin stands still in its parent's frame: joints are attached
// to the tree, hips first, where they move least over all motions. `motions` have one joint order.
std::vector<size_t> InferParents(const std::vector<const Motion*>& motions, size_t hips);

// Rotation about the vertical through the hips' ground point.
Pose Turned(const Pose& pose, const Rig& rig, double radians);

Pose Moved(const Pose& pose, const Eigen::Vector3d& offset);

// Every joint's rotation against its parent, as seen from the bind pose, times `factor` in angle; the hips
// keep heading and place, and lean `factor` times as far. Bones keep their length.
Pose Exaggerated(const Pose& pose, const Rig& rig, double factor);

// The largest rotation of a joint against its parent, away from the bind pose, in radians; the hips' lean is one of
// them.
double LargestTurn(const Pose& pose, const Rig& rig);

// `linear` is multiplied to every joint's linear part in the joint's own frame: scale, shear. Origins stay.
Pose Deformed(const Pose& pose, const Eigen::Matrix3d& linear);

// Where the character stands and looks: about +Y only, as the engine's heading frame (NETWORK.md, "Pose").
Matrix GroundFrame(const Pose& pose, const Rig& rig);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_MOTION_H_
