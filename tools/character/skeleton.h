// The joints that a garment or training wants, found in a file and brought to metres, +Y up; and its clips as a
// sequence holds them.
#ifndef DCLOTH_TOOLS_CHARACTER_SKELETON_H_
#define DCLOTH_TOOLS_CHARACTER_SKELETON_H_

#include <span>
#include <string>
#include <vector>

#include "tools/character/character_space.h"
#include "tools/character/joint_map.h"

namespace dcloth::tools {

struct Skeleton {
  std::vector<std::string> joints;
  std::vector<size_t> nodes;  // of the file, [joints]
  CharacterSpace space;
  std::vector<Eigen::Matrix4d> rest;  // RestMatrices in `space`, [joints]
};

// `wanted`: joints by name; empty: every joint of the file. Throws converter::Error where one is missing, where the
// file has none, and as SpaceOf does.
Skeleton SkeletonOf(const CharacterFile& file, const JointMap& map, std::span<const std::string> wanted,
                    const SpaceOptions& options);

// Joint frames of a file to those of a garment: tools of artists lay a bone's axes as they like.
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

struct ClipMatrices {
  size_t frame_count = 0;
  std::vector<float> values;  // [frames, joints, 4, 4], metres, +Y up; finite
};

// Frames from the first key to the last, `fps` a second. Throws converter::Error above 4 GB and where numbers leave the
// range of float.
ClipMatrices SampleClip(const CharacterFile& file, const CharacterClip& clip, const Skeleton& skeleton,
                        const Retarget& retarget, double fps);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_SKELETON_H_
