// Joint frames of a file to those of a garment: tools of artists lay a bone's axes as they like.
#ifndef DCLOTH_TOOLS_CHARACTER_RETARGET_H_
#define DCLOTH_TOOLS_CHARACTER_RETARGET_H_

#include <span>
#include <vector>

#include "tools/character/skeleton.h"

namespace dcloth::tools {

// G' = [L(G) L(R)^-1 L(B) | p(G)]: R the joint at rest in the file, B its bind in the target, L the linear and p the
// position part. Without a target's bind B is R with axes of length 1. Posed as at rest, a joint gets its bind's frame.
class Retarget {
 public:
  // `bind` [joints], world, metres; or empty. Throws converter::Error where the two skeletons, placed on one another,
  // are more than 0.3 m apart: another unit, another up axis or another pose.
  Retarget(const CharacterFile& file, const Skeleton& skeleton, std::span<const Eigen::Matrix4d> bind);

  Eigen::Matrix4d Joint(size_t joint, const Eigen::Matrix4d& world) const;

  // How far joints at rest are from the target's after both skeletons are centred; 0 without a bind.
  double farthest_metres() const { return farthest_; }
  size_t farthest_joint() const { return farthest_joint_; }

 private:
  std::vector<Eigen::Matrix3d> turn_;  // L(R)^-1 L(B)
  double farthest_ = 0;
  size_t farthest_joint_ = 0;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_RETARGET_H_
