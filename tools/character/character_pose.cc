#include "tools/character/character_pose.h"

#include <algorithm>

namespace dcloth::tools {
namespace {

struct Parts {
  Eigen::Vector3d position, scale;
  Eigen::Quaterniond rotation;
};

// Without shear, which no key can hold.
Parts Decompose(const Eigen::Matrix4d& matrix) {
  Parts parts;
  parts.position = matrix.topRightCorner<3, 1>();
  Eigen::Matrix3d rotation = matrix.topLeftCorner<3, 3>();
  const double sign = rotation.determinant() < 0 ? -1 : 1;
  for (int c = 0; c < 3; ++c) {
    parts.scale[c] = sign * rotation.col(c).norm();
    if (parts.scale[c] != 0) rotation.col(c) /= parts.scale[c];
  }
  parts.rotation = Eigen::Quaterniond(rotation).normalized();
  return parts;
}

// The keys around `seconds` and the share of the second.
template <typename Value>
struct Around {
  const Value *before, *after;
  double share;
};
template <typename Value>
Around<Value> Find(const Keys<Value>& keys, double seconds) {
  const auto after = std::ranges::upper_bound(keys, seconds, {}, &std::pair<double, Value>::first);
  if (after == keys.begin()) return {&keys.front().second, &keys.front().second, 0};
  if (after == keys.end()) return {&keys.back().second, &keys.back().second, 0};
  const auto before = after - 1;
  return {&before->second, &after->second, (seconds - before->first) / (after->first - before->first)};
}

Eigen::Vector3d At(const Keys<Eigen::Vector3d>& keys, double seconds) {
  const auto [a, b, t] = Find(keys, seconds);
  return (1 - t) * *a + t * *b;
}

Eigen::Matrix4d Local(const CharacterNode& node, const NodeChannel& channel, double seconds) {
  Parts parts = Decompose(node.local);
  if (!channel.positions.empty()) parts.position = At(channel.positions, seconds);
  if (!channel.scales.empty()) parts.scale = At(channel.scales, seconds);
  if (!channel.rotations.empty()) {
    const auto [a, b, t] = Find(channel.rotations, seconds);
    parts.rotation = a->slerp(t, *b);
  }
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  out.topLeftCorner<3, 3>() = parts.rotation.toRotationMatrix() * parts.scale.asDiagonal();
  out.topRightCorner<3, 1>() = parts.position;
  return out;
}

}  // namespace

std::vector<Eigen::Matrix4d> WorldMatrices(const CharacterFile& file, const CharacterClip* clip, double seconds) {
  std::vector<Eigen::Matrix4d> world(file.nodes.size());
  for (size_t i = 0; i < world.size(); ++i) world[i] = file.nodes[i].local;
  if (clip != nullptr) {
    for (const NodeChannel& channel : clip->channels) {
      world[channel.node] = Local(file.nodes[channel.node], channel, seconds);
    }
  }
  for (size_t i = 0; i < world.size(); ++i) {
    const int32_t parent = file.nodes[i].parent;
    if (parent >= 0) world[i] = world[static_cast<size_t>(parent)] * world[i];
  }
  return world;
}

std::vector<Eigen::Matrix4d> RestMatrices(const CharacterFile& file) {
  std::vector<Eigen::Matrix4d> rest = WorldMatrices(file, nullptr, 0);
  for (size_t i = 0; i < rest.size(); ++i) {
    if (file.nodes[i].bind) rest[i] = *file.nodes[i].bind;
  }
  return rest;
}

}  // namespace dcloth::tools
