// The host's rig and the model's: which joint is which, by name, and joints that have axes of their own, by the bind
// pose.
//
// The world's motion from bind pose to pose, D_j = G_j P_j^-1, is the same whatever axes a joint was given; in the
// model's space and times the joint's matrix of training, B_j, it is the G_j that the network knows.
#ifndef DCLOTH_ENGINE_SRC_POSE_HOST_RIG_H_
#define DCLOTH_ENGINE_SRC_POSE_HOST_RIG_H_

#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"
#include "engine/format/view.h"
#include "engine/src/pose/pose.h"

namespace dcloth::engine {

// By cofactors. False where a number of the inverse leaves the range of poses.
bool Invert(const Affine& a, Affine* inverse);

// Takes P_j^-1 of every joint of the model into the binding; refused, it changes nothing.
bool TakeBindPose(const format::ModelView& model, const dcloth_pose& bind, HostRig* rig,
                  format::Diagnostic* diagnostic);

// B_j, the joint's matrix in the bind pose of training. False where the model's inverse has none.
bool BindMatrix(const format::ModelView& model, size_t joint, Affine* bind);

// G_j in the model's space from the host's, by D_j.
Affine FromBindPose(const format::ModelView& model, const HostRig& rig, size_t joint, const Affine& host);

// Writes the host's index of each of the `wanted` joints into `joint_map`, [wanted_count]; of equal names the first.
// False where some are missing: the text names them, and `joint_map` is untouched.
bool MatchJoints(const char* const* wanted, uint32_t wanted_count, const char* const* names, uint32_t count,
                 uint32_t* joint_map, format::Diagnostic* diagnostic);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_POSE_HOST_RIG_H_
