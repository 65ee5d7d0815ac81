#include "engine/src/bind_pose.h"

#include "engine/format/view.h"

namespace dcloth::engine {
namespace {

// Times the largest matrix of a pose, it stays far from what a float cannot square.
constexpr double kLargest = 1e6;

// By cofactors. False where that, or rounding, leaves numbers beyond kLargest.
bool Invert(const Affine& a, Affine* inverse) {
  bool usable = true;
  const auto cofactor = [&a](int r0, int r1, int c0, int c1) {
    return a.m[r0][c0] * a.m[r1][c1] - a.m[r0][c1] * a.m[r1][c0];
  };
  for (int r = 0; r < 3; ++r) {
    const int r1 = (r + 1) % 3, r2 = (r + 2) % 3;
    for (int c = 0; c < 3; ++c) inverse->m[r][c] = cofactor((c + 1) % 3, (c + 2) % 3, r1, r2);
  }
  const double volume = a.m[0][0] * inverse->m[0][0] + a.m[0][1] * inverse->m[1][0] + a.m[0][2] * inverse->m[2][0];
  for (int r = 0; r < 3; ++r) {
    double* row = inverse->m[r];
    for (int c = 0; c < 3; ++c) row[c] /= volume;
    row[3] = -(row[0] * a.m[0][3] + row[1] * a.m[1][3] + row[2] * a.m[2][3]);
    for (int c = 0; c < 4; ++c) usable &= row[c] >= -kLargest && row[c] <= kLargest;
  }
  return usable;
}

}  // namespace

bool TakeBindPose(const format::ModelView& model, const dcloth_pose& bind, PoseBinding* binding,
                  format::Diagnostic* diagnostic) {
  const auto refuse = [&](const char* found) {
    return diagnostic->Fail(DCLOTH_ERROR_POSE, format::kNoOffset, nullptr, found,
                            "as many as in a pose, each with an inverse", "");
  };
  if (!PoseIsUsable(model, *binding, bind)) return refuse("NaN, beyond 1e9 or another count");
  Affine inverse;
  for (size_t j = 0; j < model.joint_count; ++j) {
    if (Invert(JointMatrix(bind, binding->joint_map[j]), &inverse) && Invert(InverseBind(model, j), &inverse)) continue;
    char found[150];
    format::Text(found, sizeof(found)).Add("no inverse for joint '").Add(format::JointName(model, j)).Add("'");
    return refuse(found);
  }
  for (size_t j = 0; j < model.joint_count; ++j)
    Invert(JointMatrix(bind, binding->joint_map[j]), &binding->inverse_bind[j]);
  binding->has_bind_pose = true;
  return true;
}

Affine FromBindPose(const format::ModelView& model, const PoseBinding& binding, size_t joint, const Affine& host) {
  Space world = binding.space;
  world.turn_joints = true;
  Affine bind;
  Invert(InverseBind(model, joint), &bind);
  return FromHost(world, host * binding.inverse_bind[joint]) * bind;
}

}  // namespace dcloth::engine
