#include "tools/character/retarget.h"

#include <cmath>
#include <cstdio>

#include "converter/error.h"

namespace dcloth::tools {
namespace {

constexpr double kOtherSkeleton = 0.3;  // metres: people of one kind differ by less, poses and axes by more

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

}  // namespace dcloth::tools
