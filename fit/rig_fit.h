// A garment's skeleton laid into a character's: which joint is which, the character's size, where each of the garment's
// joints belongs in the character's bind pose.
//
// Rotations are the character's, relative to its bind pose; proportions within a joint's part are the figure's, times
// one scale. F_j takes the figure's bind pose to the character's: a turn C_j between the two stances about the joint,
// then its place there. In a pose G_j of the character's joint with bind pose P_j, the garment's joint has moved by G_j
// P_j^-1 F_j.
#ifndef DCLOTH_FIT_RIG_FIT_H_
#define DCLOTH_FIT_RIG_FIT_H_

#include <cstdint>

#include "dcloth/dcloth_fit.h"
#include "engine/format/diagnostic.h"
#include "engine/format/fit_file.h"
#include "engine/format/view.h"
#include "engine/src/pose/pose.h"
#include "fit/joint_roles.h"

namespace dcloth::fit {

using engine::Affine;
using engine::Space;

struct Vector {
  double x, y, z;
};

struct Turn3 {
  double m[3][3];
};

// The joints of one skeleton that have a role, metres in the model's axes. -1 where there is none.
constexpr uint32_t kMostTrunkJoints = 8;
struct RoleJoints {
  int32_t joint[kRoleCount];  // not of the trunk: those are told apart by height alone
  Vector at[kRoleCount];
  int32_t trunk[kMostTrunkJoints];  // from the hips up
  Vector trunk_at[kMostTrunkJoints];
  uint32_t trunk_count;
};

struct RigFit {
  RoleJoints figure, character;
  Space space;                             // the host's, its own unit
  Vector figure_middle, character_middle;  // between the hip joints
  Turn3 figure_frame, character_frame;     // columns: left, up, forward of the trunk
  double trunk_ratio;                      // length of the trunk, the character's over the figure's
  Turn3 turn[kRoleCount];                  // C
  double bone_scale;                       // character over figure
};

// Finds roles, compares the skeletons, fills the report's fields that bones decide. Refused with JOINTS or POSE, told
// in `diagnostic`; `rig` gives the space.
bool MeasureRig(const format::ModelView& model, const dcloth_character& character, const Space& space, RigFit* fit,
                dcloth_fit* report, format::Diagnostic* diagnostic);

// F_j in the model's axes, in metres over `scale` on both sides, and the character's joint that moves the model's
// `joint`.
struct PlacedJoint {
  Affine place;
  uint32_t host;
  bool stands_in;
};
PlacedJoint PlaceJoint(const format::ModelView& model, const RigFit& fit, double scale, uint32_t joint);

// Fills `joints`, [joint_count] of the model; it cannot fail.
void WriteJoints(const format::ModelView& model, const dcloth_character& character, const RigFit& fit, double scale,
                 format::FitJoint* joints);

// The host's matrix `joint` in the bind pose.
Affine CharacterBind(const dcloth_character& character, size_t joint);

}  // namespace dcloth::fit

#endif  // DCLOTH_FIT_RIG_FIT_H_
