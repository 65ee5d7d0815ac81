#include "engine/src/pose/pose.h"

#include <cmath>
#include <cstddef>
#include <cstring>

#include "engine/src/pose/affine.h"
#include "engine/src/pose/host_rig.h"

namespace dcloth::engine {
namespace {

constexpr size_t kPoseFloats = 16;
constexpr double kShortestHeading = 0.2;  // of the projected left axis; NETWORK.md
constexpr double kSmallestVolume = 1e-6;  // of a joint's linear part: scaled to 1 % along each axis; NETWORK.md

// The hips' left axis on the ground; the heading before where the hips lie or stand on their side.
Heading HeadingOf(const Affine& hips, const Heading& before) {
  const double x = hips.m[0][0], z = hips.m[2][0];
  const double length = std::sqrt(x * x + z * z);
  if (length < kShortestHeading) return before;
  return {x / length, -z / length};
}

// Hosts scale limbs to zero to hide them, and some send zeros before a character is posed: no rotation can be
// read there.
bool IsCollapsed(const Affine& a) {
  const double volume = a.m[0][0] * (a.m[1][1] * a.m[2][2] - a.m[1][2] * a.m[2][1]) -
                        a.m[0][1] * (a.m[1][0] * a.m[2][2] - a.m[1][2] * a.m[2][0]) +
                        a.m[0][2] * (a.m[1][0] * a.m[2][1] - a.m[1][1] * a.m[2][0]);
  return volume > -kSmallestVolume && volume < kSmallestVolume;
}

// Signed angle from `from` to `to` in (-pi, pi]: the wrapped difference of two yaws.
double Turn(const Heading& from, const Heading& to) {
  return AngleOf(to.sine * from.cosine - to.cosine * from.sine, to.cosine * from.cosine + to.sine * from.sine);
}

Affine Translation(const double (&vector)[3]) {
  Affine translation = {};
  for (int r = 0; r < 3; ++r) translation.m[r][3] = vector[r];
  return translation;
}

// Backward differences over the time since the last tick; none after a reset, the last ones after a jump. Between ticks
// of different lengths a velocity is that of the middle. `acceleration` of the hips is in the heading frame, m/s^2:
// zero until two velocities are known, and in the tick of a jump.
void UpdateVelocity(const SkinPose& skin, const Heading& heading, double tick_rate, double elapsed_ticks,
                    RootMotion* root, double (&acceleration)[3]) {
  for (double& a : acceleration) a = 0;
  if (root->jumped) {
    if (root->velocity_age > 0) root->velocity_age += elapsed_ticks;
    return;
  }
  const double rate = root->started ? tick_rate / elapsed_ticks : 0;
  double now[3];
  for (int r = 0; r < 3; ++r) now[r] = (skin.origin[r] - root->position[r]) * rate;
  if (root->velocity_age > 0) {
    const Heading back = {root->heading.cosine, -root->heading.sine};
    const Affine before = ToHeading(back, Translation(root->velocity));
    double change[3];
    const double change_rate = tick_rate / (root->velocity_age + elapsed_ticks / 2);
    for (int r = 0; r < 3; ++r) change[r] = (now[r] - before.m[r][3]) * change_rate;
    const Affine local = ToHeading(heading, Translation(change));
    for (int r = 0; r < 3; ++r) acceleration[r] = local.m[r][3];
  }
  const Affine velocity = ToHeading(heading, Translation(now));
  for (int r = 0; r < 3; ++r) root->velocity[r] = velocity.m[r][3];
  root->velocity_age = root->started ? elapsed_ticks / 2 : 0;
  root->yaw_rate = Turn(root->heading, heading) * rate;
}

// In double all the way, so that no finite pose overflows before the clamp.
float Standardise(const format::FeaturesView& features, size_t i, double value) {
  const double low = static_cast<double>(features.low[i]), high = static_cast<double>(features.high[i]);
  const double x = (value - static_cast<double>(features.mean[i])) * static_cast<double>(features.inverse_deviation[i]);
  return static_cast<float>(x < low ? low : x > high ? high : x);
}

}  // namespace

Affine JointMatrix(const dcloth_pose& pose, size_t joint) {
  const float* g = pose.joint_matrices + joint * kPoseFloats;
  Affine matrix;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c)
      matrix.m[r][c] = static_cast<double>(pose.column_major != 0 ? g[4 * c + r] : g[4 * r + c]);
  }
  return matrix;
}

Affine InverseBind(const format::ModelView& model, size_t joint) {
  const float* rows = model.inverse_bind + joint * 12;
  Affine matrix;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) matrix.m[r][c] = static_cast<double>(rows[4 * r + c]);
  }
  return matrix;
}

bool PoseIsUsable(const format::ModelView& model, const HostRig& rig, const dcloth_pose& pose) {
  if (pose.joint_count != rig.host_joint_count) return false;
  bool usable = true;
  for (size_t j = 0; j < model.joint_count; ++j) {
    const float* matrix = pose.joint_matrices + rig.joint_map[j] * kPoseFloats;
    for (size_t i = 0; i < kPoseFloats; ++i)
      usable &= matrix[i] >= -kMaxPoseMagnitude && matrix[i] <= kMaxPoseMagnitude;
  }
  return usable;
}

void ExplainPose(const format::ModelView& model, const HostRig& rig, const dcloth_pose& pose,
                 format::Diagnostic* diagnostic) {
  const format::Path parent = {nullptr, "pose"};
  if (pose.joint_count != rig.host_joint_count) {
    const format::Path path = {&parent, "joint_count"};
    char allowed[64];
    format::Text(allowed, sizeof(allowed)).Add(uint64_t{rig.host_joint_count});
    diagnostic->FailCount(DCLOTH_ERROR_POSE, format::kNoOffset, &path, pose.joint_count, "", allowed,
                          "a matrix for each joint of the model, or for each name that was bound");
    return;
  }
  for (size_t j = 0; j < model.joint_count; ++j) {
    const float* matrix = pose.joint_matrices + rig.joint_map[j] * kPoseFloats;
    for (size_t i = 0; i < kPoseFloats; ++i) {
      if (matrix[i] >= -kMaxPoseMagnitude && matrix[i] <= kMaxPoseMagnitude) continue;
      const format::Path all = {&parent, "joint_matrices"}, path = {&all, nullptr, rig.joint_map[j]};
      char found[128];
      format::Text(found, sizeof(found))
          .AddNumber(static_cast<double>(matrix[i]))
          .Add(" in the matrix of '")
          .AddName(format::JointName(model, static_cast<uint32_t>(j)))
          .Add("'");
      diagnostic->Fail(DCLOTH_ERROR_POSE, format::kNoOffset, &path, found, "finite numbers up to 1e9", "");
      return;
    }
  }
  const format::Path path = {&parent, "joint_matrices"};
  diagnostic->Fail(DCLOTH_ERROR_POSE, format::kNoOffset, &path, "a joint that its bind pose puts beyond 1e12 m",
                   "joints within 1e12 m", "use the same scale in the bind pose and in poses");
}

bool ReadPose(const format::ModelView& model, const HostRig& rig, const dcloth_pose& pose, Affine* joints) {
  if (!PoseIsUsable(model, rig, pose)) return false;
  bool usable = true;
  for (size_t j = 0; j < model.joint_count; ++j) {
    const Affine host = JointMatrix(pose, rig.joint_map[j]);
    joints[j] = rig.has_bind_pose ? FromBindPose(model, rig, j, host) : FromHost(rig.space, host);
    for (const auto& row : joints[j].m) {
      for (const double value : row) usable &= value >= -kLargestJoint && value <= kLargestJoint;
    }
  }
  return usable;
}

void MakeSkinPose(const format::ModelView& model, const Affine* pose, SkinPose* skin) {
  for (int r = 0; r < 3; ++r) skin->origin[r] = pose[model.hips].m[r][3];
  for (size_t j = 0; j < model.joint_count; ++j) {
    Affine matrix = pose[j];
    for (int r = 0; r < 3; ++r) matrix.m[r][3] -= skin->origin[r];
    skin->joints[j] = matrix * InverseBind(model, j);
  }
}

Affine ToHeading(const Heading& heading, const Affine& matrix) {
  Affine local;
  for (int c = 0; c < 4; ++c) {
    const double x = matrix.m[0][c], z = matrix.m[2][c];
    local.m[0][c] = heading.cosine * x - heading.sine * z;
    local.m[1][c] = matrix.m[1][c];
    local.m[2][c] = heading.sine * x + heading.cosine * z;
  }
  return local;
}

void UpdateFeatures(const format::ModelView& model, const SkinPose& skin, const double (&wind)[3], double elapsed_ticks,
                    RootMotion* root, float* x) {
  const format::FeaturesView& features = model.features;
  const Heading heading = HeadingOf(skin.joints[model.hips], root->heading);
  if (ReadsWind(model)) std::memcpy(root->wind, wind, sizeof(root->wind));
  size_t i = 0;
  for (size_t joint = 0; joint < features.joint_count; ++joint) {
    const Affine local = ToHeading(heading, skin.joints[features.joints[joint]]);
    if (IsCollapsed(local)) {
      i += 9;
      continue;
    }
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c, ++i) x[i] = Standardise(features, i, local.m[r][c]);
    }
  }
  if (features.root != format::RootKind::kNone) {
    const bool air = features.root == format::RootKind::kAir;
    double acceleration[3];
    UpdateVelocity(skin, heading, static_cast<double>(model.tick_rate), elapsed_ticks, root, acceleration);
    const Affine blown = ToHeading(heading, Translation(root->wind));
    for (int r = 0; r < 3; ++r, ++i)
      x[i] = Standardise(features, i, air ? blown.m[r][3] - root->velocity[r] : root->velocity[r]);
    x[i] = Standardise(features, i, root->yaw_rate);
    ++i;
    for (int r = 0; air && r < 3; ++r, ++i) x[i] = Standardise(features, i, acceleration[r]);
  }
  root->heading = heading;
  for (int r = 0; r < 3; ++r) root->position[r] = skin.origin[r];
  root->started = true;
  root->jumped = false;
}

}  // namespace dcloth::engine
