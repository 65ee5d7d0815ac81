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

Eigen::Vector3d Straight(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double t) { return (1 - t) * a + t * b; }
Eigen::Quaterniond Straight(const Eigen::Quaterniond& a, const Eigen::Quaterniond& b, double t) {
  return a.slerp(t, b);
}

const Eigen::Vector3d& Numbers(const Eigen::Vector3d& value) { return value; }
const Eigen::Vector4d& Numbers(const Eigen::Quaterniond& value) { return value.coeffs(); }

// glTF 2.0, appendix C.
template <typename Value>
Value At(const Curve<Value>& curve, double seconds) {
  const auto& keys = curve.keys;
  const auto after = std::ranges::upper_bound(keys, seconds, {}, &std::pair<double, Value>::first);
  if (after == keys.begin()) return keys.front().second;
  const auto before = after - 1;
  if (after == keys.end() || curve.holds) return before->second;
  const double span = after->first - before->first, t = (seconds - before->first) / span;
  if (curve.tangents.empty()) return Straight(before->second, after->second, t);
  const auto key = static_cast<size_t>(before - keys.begin());
  const double t2 = t * t, t3 = t2 * t;
  return Value((2 * t3 - 3 * t2 + 1) * Numbers(before->second) +
               span * (t3 - 2 * t2 + t) * Numbers(curve.tangents[key][1]) + (3 * t2 - 2 * t3) * Numbers(after->second) +
               span * (t3 - t2) * Numbers(curve.tangents[key + 1][0]));
}

Eigen::Matrix4d Local(const CharacterNode& node, const NodeChannel& channel, double seconds) {
  Parts parts = Decompose(node.local);
  if (!channel.positions.keys.empty()) parts.position = At(channel.positions, seconds);
  if (!channel.scales.keys.empty()) parts.scale = At(channel.scales, seconds);
  if (!channel.rotations.keys.empty()) parts.rotation = At(channel.rotations, seconds).normalized();
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

void SetSpan(CharacterClip* clip) {
  bool any = false;
  const auto include = [&](const auto& keys) {
    if (keys.empty()) return;
    clip->first_seconds = any ? std::min(clip->first_seconds, keys.front().first) : keys.front().first;
    clip->last_seconds = any ? std::max(clip->last_seconds, keys.back().first) : keys.back().first;
    any = true;
  };
  for (const NodeChannel& channel : clip->channels) {
    include(channel.positions.keys);
    include(channel.rotations.keys);
    include(channel.scales.keys);
  }
}

}  // namespace dcloth::tools
