// A rig whose joints have axes of their own: the character's bind pose as the host has it.
//
// The world's motion from bind pose to pose, D_j = G_j P_j^-1, is the same whatever axes a joint was given; in the model's
// space and times the joint's matrix of training, B_j, it is the G_j that the network knows.
#ifndef DCLOTH_ENGINE_SRC_BIND_POSE_H_
#define DCLOTH_ENGINE_SRC_BIND_POSE_H_

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"
#include "engine/src/pose.h"

namespace dcloth::engine {

// Takes P_j^-1 of every joint of the model into the binding; refused, it changes nothing.
bool TakeBindPose(const format::ModelView& model, const dcloth_pose& bind, PoseBinding* binding,
                  format::Diagnostic* diagnostic);

// G_j in the model's space from the host's, by D_j.
Affine FromBindPose(const format::ModelView& model, const PoseBinding& binding, size_t joint, const Affine& host);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BIND_POSE_H_
