#include "engine/src/pose/host_rig.h"

#include <cstring>

#include "engine/format/view.h"

namespace dcloth::engine {
namespace {

// Times the largest matrix of a pose, it stays far from what a float cannot square.
constexpr double kLargest = 1e6;

constexpr uint32_t kMissing = UINT32_MAX;

uint32_t Find(const char* name, const char* const* names, uint32_t count) {
  const size_t size = std::strlen(name) + 1;
  for (uint32_t i = 0; i < count; ++i) {
    if (names[i] != nullptr && std::strncmp(names[i], name, size) == 0) return i;
  }
  return kMissing;
}

// "2 of 6 joints missing: 'hips', 'chest'", as many names as fit.
void ListMissing(const char* const* wanted, uint32_t wanted_count, const char* const* names, uint32_t count,
                 uint32_t missing, char* text, size_t size) {
  constexpr size_t kRoomForRest = 20;  // ", and 255 more"
  format::Text out(text, size);
  out.Add(uint64_t{missing}).Add(" of ").Add(uint64_t{wanted_count}).Add(" joints missing:");
  uint32_t listed = 0;
  for (uint32_t j = 0; j < wanted_count; ++j) {
    const char* name = wanted[j];
    if (Find(name, names, count) != kMissing) continue;
    if (std::strlen(text) + std::strlen(name) + 4 + kRoomForRest > size) break;
    out.Add(listed == 0 ? " '" : ", '").AddName(name).Add("'");
    ++listed;
  }
  if (listed < missing) out.Add(listed == 0 ? " " : ", and ").Add(uint64_t{missing - listed}).Add(" more");
}

}  // namespace

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

bool TakeBindPose(const format::ModelView& model, const dcloth_pose& bind, HostRig* rig,
                  format::Diagnostic* diagnostic) {
  const auto refuse = [&](const char* found) {
    return diagnostic->Fail(DCLOTH_ERROR_POSE, format::kNoOffset, nullptr, found,
                            "invertible matrices, as many as in a pose", "");
  };
  if (!PoseIsUsable(model, *rig, bind)) return refuse("a number that is NaN or beyond 1e9, or another count of joints");
  Affine inverse;
  for (size_t j = 0; j < model.joint_count; ++j) {
    if (Invert(JointMatrix(bind, rig->joint_map[j]), &inverse) && Invert(InverseBind(model, j), &inverse)) continue;
    char found[150];
    format::Text(found, sizeof(found)).Add("no inverse for joint '").Add(format::JointName(model, j)).Add("'");
    return refuse(found);
  }
  for (size_t j = 0; j < model.joint_count; ++j) Invert(JointMatrix(bind, rig->joint_map[j]), &rig->inverse_bind[j]);
  rig->has_bind_pose = true;
  return true;
}

bool BindMatrix(const format::ModelView& model, size_t joint, Affine* bind) {
  return Invert(InverseBind(model, joint), bind);
}

Affine FromBindPose(const format::ModelView& model, const HostRig& rig, size_t joint, const Affine& host) {
  Space world = rig.space;
  world.converts_joints = true;
  Affine bind;
  Invert(InverseBind(model, joint), &bind);
  return FromHost(world, host * rig.inverse_bind[joint]) * bind;
}

bool MatchJoints(const char* const* wanted, uint32_t wanted_count, const char* const* names, uint32_t count,
                 uint32_t* joint_map, format::Diagnostic* diagnostic) {
  uint32_t missing = 0;
  for (uint32_t j = 0; j < wanted_count; ++j) {
    if (Find(wanted[j], names, count) == kMissing) ++missing;
  }
  if (missing != 0) {
    char found[150];
    ListMissing(wanted, wanted_count, names, count, missing, found, sizeof(found));
    return diagnostic->Fail(DCLOTH_ERROR_JOINTS, format::kNoOffset, nullptr, found, "every joint of the model",
                            "name the skeleton's joints as in training");
  }
  for (uint32_t j = 0; j < wanted_count; ++j) joint_map[j] = Find(wanted[j], names, count);
  return true;
}

}  // namespace dcloth::engine
