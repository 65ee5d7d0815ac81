// The host's pose as the network sees it (NETWORK.md, "Pose"): relative to the hips, in the heading frame, as features.
#ifndef DCLOTH_ENGINE_SRC_POSE_POSE_H_
#define DCLOTH_ENGINE_SRC_POSE_POSE_H_

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"
#include "engine/format/view.h"
#include "engine/src/pose/affine.h"
#include "engine/src/pose/space.h"

namespace dcloth::engine {

// Larger numbers in a pose are refused like infinity, so that no pose can drive the recurrent state out of float range.
constexpr float kMaxPoseMagnitude = 1e9f;
// Of the same in metres: what the largest unit makes of it. A bind pose may make more, which is refused too.
constexpr double kLargestJoint = 1e3 * static_cast<double>(kMaxPoseMagnitude);

// How a host gives its poses.
struct HostRig {
  Space space;
  uint32_t host_joint_count;  // matrices in a pose
  uint32_t* joint_map;        // [joint_count], the host's index of each joint of the model
  Affine* inverse_bind;       // [joint_count], P_j^-1 in the host's space, see host_rig.h
  bool has_bind_pose;
};

// The host's matrix `joint`.
Affine JointMatrix(const dcloth_pose& pose, size_t joint);

// B_j^-1 of training.
Affine InverseBind(const format::ModelView& model, size_t joint);

// Every joint is there and every matrix element of the model's joints is finite.
bool PoseIsUsable(const format::ModelView& model, const HostRig& rig, const dcloth_pose& pose);

// Of a pose that is not usable: tells why.
void ExplainPose(const format::ModelView& model, const HostRig& rig, const dcloth_pose& pose,
                 format::Diagnostic* diagnostic);

// G_j of every joint, [joint_count], in the model's space. False, whatever `joints` hold then, where the pose is not
// usable or a number comes out above kLargestJoint.
bool ReadPose(const format::ModelView& model, const HostRig& rig, const dcloth_pose& pose, Affine* joints);

// What skins a frame: G_j B_j^-1 of every joint, with the hips' world position taken off all translations.
struct SkinPose {
  Affine* joints;    // [joint_count]
  double origin[3];  // the hips' world position
};
// `pose` may be `skin->joints`.
void MakeSkinPose(const format::ModelView& model, const Affine* pose, SkinPose* skin);

// H's rotation about +Y: its X axis is (cosine, 0, -sine).
struct Heading {
  double cosine = 1.0;
  double sine = 0.0;
};

// Where the character was, faced and went at the last tick.
struct RootMotion {
  Heading heading;
  double position[3] = {};
  double velocity[3] = {};  // m/s, in the heading frame
  double velocity_age =
      0;                 // ticks to the last one from the middle of the time it was measured over; 0: not measured yet
  double yaw_rate = 0;   // rad/s
  double wind[3] = {};   // m/s in the world; zero where the model does not read it
  bool started = false;  // false after a reset: no velocity yet
  bool jumped = false;   // moved by the host since then, not by its own legs: the velocity stays
};

// Then a change of the wind moves a cloth that hangs still.
inline bool ReadsWind(const format::ModelView& model) {
  return model.features.root == format::RootKind::kAir || model.patch_stage.patch_count != 0;
}

// H^-1 M for a matrix whose origin is the hips.
Affine ToHeading(const Heading& heading, const Affine& matrix);

// Moves `root` to this tick, `elapsed_ticks` after the last one, and writes the standardised, clamped
// features x [d]. A collapsed joint leaves its nine as they were, so x lives as long as the cloth.
// `wind` is in m/s in the world.
void UpdateFeatures(const format::ModelView& model, const SkinPose& skin, const double (&wind)[3], double elapsed_ticks,
                    RootMotion* root, float* x);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_POSE_POSE_H_
