#include "tools/character/skeleton.h"

#include <cmath>
#include <cstdint>
#include <cstdio>

#include "converter/error.h"
#include "tools/character/character_pose.h"
#include "tools/character/matrix_values.h"

namespace dcloth::tools {

Skeleton SkeletonOf(const CharacterFile& file, const JointMap& map, std::span<const std::string> wanted,
                    const SpaceOptions& options) {
  Skeleton skeleton;
  skeleton.joints.assign(wanted.begin(), wanted.end());
  if (wanted.empty()) skeleton.joints = JointsOf(file, map);
  skeleton.nodes = FindJoints(file, map, skeleton.joints);
  if (skeleton.nodes.empty()) {
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "neither bones nor animated nodes",
                            .expected = "a skeleton",
                            .mend = "export the character with its armature"});
  }
  const std::vector<Eigen::Matrix4d> all = RestMatrices(file);
  for (size_t j = 0; j < skeleton.nodes.size(); ++j) {
    skeleton.rest.push_back(all[skeleton.nodes[j]]);
    if (!skeleton.rest.back().allFinite()) RefuseNumbers(file, "joint '" + skeleton.joints[j] + "' at rest");
  }
  skeleton.space = SpaceOf(file, options, skeleton.rest);
  for (Eigen::Matrix4d& joint : skeleton.rest) joint = skeleton.space.World(joint);
  return skeleton;
}

namespace {

constexpr double kOtherSkeleton = 0.3;  // metres: people of one kind differ by less, poses and axes by more

constexpr uint64_t kMaxBytes = uint64_t{4} << 30;

}  // namespace

Retarget::Retarget(const CharacterFile& file, const Skeleton& skeleton, std::span<const Eigen::Matrix4d> bind) {
  const std::vector<Eigen::Matrix4d>& rest = skeleton.rest;
  const std::vector<std::string>& joints = skeleton.joints;
  Eigen::Vector3d apart = Eigen::Vector3d::Zero();
  for (size_t j = 0; j < rest.size(); ++j) {
    const Eigen::Matrix3d linear = rest[j].topLeftCorner<3, 3>();
    const Eigen::Vector3d length = linear.colwise().norm();
    if (std::abs(linear.determinant()) < 1e-12 || length.minCoeff() < 1e-6) {
      throw converter::Error({.path = file.path,
                              .tensor = {},
                              .found = "a scale of 0 for the joint '" + joints[j] + "' in the rest pose",
                              .expected = "a scale other than 0",
                              .mend = "set the scale of the bone and export again"});
    }
    if (bind.empty()) {
      turn_.emplace_back(length.cwiseInverse().asDiagonal());
    } else {
      turn_.emplace_back(linear.inverse() * bind[j].topLeftCorner<3, 3>());
      apart += (rest[j] - bind[j]).topRightCorner<3, 1>() / static_cast<double>(rest.size());
    }
  }
  if (bind.empty()) return;
  for (size_t j = 0; j < rest.size(); ++j) {
    const double distance = ((rest[j] - bind[j]).topRightCorner<3, 1>() - apart).norm();
    if (distance > farthest_) {
      farthest_ = distance;
      farthest_joint_ = j;
    }
  }
  if (farthest_ <= kOtherSkeleton) return;
  char found[64];
  std::snprintf(found, sizeof found, "at rest %.3g m from its place in", farthest_);
  throw converter::Error({.path = file.path,
                          .tensor = {},
                          .found = "joint '" + joints[farthest_joint_] + "' " + found + " the garment's bind pose",
                          .expected = "the same skeleton within 0.3 m",
                          .mend = "check the unit (--unit), the up axis (--up), and that both rest in the same pose"});
}

Eigen::Matrix4d Retarget::Joint(size_t joint, const Eigen::Matrix4d& world) const {
  Eigen::Matrix4d out = world;
  out.topLeftCorner<3, 3>() = world.topLeftCorner<3, 3>() * turn_[joint];
  return out;
}

ClipMatrices SampleClip(const CharacterFile& file, const CharacterClip& clip, const Skeleton& skeleton,
                        const Retarget& retarget, double fps) {
  const size_t joint_count = skeleton.nodes.size();
  const double seconds = clip.last_seconds - clip.first_seconds;
  const double frames = std::floor(seconds * fps + 1e-3) + 1;
  if (frames * static_cast<double>(joint_count) * 64 > static_cast<double>(kMaxBytes)) {
    char found[64];
    std::snprintf(found, sizeof found, "%.9g s at %.9g Hz", seconds, fps);
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = found,
                            .expected = "a sequence of at most 4 GB",
                            .mend = "shorten the clip or lower --fps"});
  }
  ClipMatrices out;
  out.frame_count = static_cast<size_t>(frames);
  out.values.reserve(out.frame_count * joint_count * 16);
  for (size_t f = 0; f < out.frame_count; ++f) {
    const auto world = WorldMatrices(file, &clip, clip.first_seconds + static_cast<double>(f) / fps);
    for (size_t j = 0; j < joint_count; ++j) {
      const Eigen::Matrix4d joint = retarget.Joint(j, skeleton.space.World(world[skeleton.nodes[j]]));
      if (!AppendMatrix(joint, &out.values)) {
        RefuseNumbers(file, "joint '" + skeleton.joints[j] + "', frame " + std::to_string(f));
      }
    }
  }
  return out;
}

}  // namespace dcloth::tools
