#include "engine/src/pose/space.h"

namespace dcloth::engine {

namespace {

bool Refuse(const char* field, const char* found, const char* allowed, format::Diagnostic* diagnostic) {
  const format::Path parent = {nullptr, "space"}, path = {&parent, field};
  return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, format::kNoOffset, &path, found, allowed, "");
}

bool RefuseNumber(const char* field, uint32_t found, const char* allowed, format::Diagnostic* diagnostic) {
  char number[16];
  format::Text(number, sizeof(number)).Add(uint64_t{found});
  return Refuse(field, number, allowed, diagnostic);
}

}  // namespace

bool MakeSpace(const dcloth_space& described, Space* space, format::Diagnostic* diagnostic) {
  constexpr float kSmallest = 1e-4f, kLargest = 1e3f;
  static constexpr const char* kNames[3] = {"left", "up", "forward"};
  static constexpr const char* kTaken[2] = {"the axis of left", "the axis of up"};
  const uint32_t axes[3] = {described.left, described.up, described.forward};
  Space made;
  for (int i = 0; i < 3; ++i) {
    if (axes[i] > DCLOTH_AXIS_MINUS_Z) return RefuseNumber(kNames[i], axes[i], "DCLOTH_AXIS_*", diagnostic);
    made.axis[i] = static_cast<uint8_t>(axes[i] / 2);
    made.sign[i] = axes[i] % 2 != 0 ? -1 : 1;
    for (int other = 0; other < i; ++other) {
      if (made.axis[i] == made.axis[other])
        return Refuse(kNames[i], kTaken[other], "left, up and forward along three different axes", diagnostic);
    }
  }
  if (!(described.metres_per_unit >= kSmallest && described.metres_per_unit <= kLargest)) {
    char number[32];
    format::Text(number, sizeof(number)).AddNumber(static_cast<double>(described.metres_per_unit));
    return Refuse("metres_per_unit", number, "0.0001 to 1000", diagnostic);
  }
  if (described.joint_frames > DCLOTH_JOINT_FRAMES_KEPT)
    return RefuseNumber("joint_frames", described.joint_frames, "DCLOTH_JOINT_FRAMES_*", diagnostic);
  made.metres_per_unit = static_cast<double>(described.metres_per_unit);
  made.converts_joints = described.joint_frames == DCLOTH_JOINT_FRAMES_CONVERTED;
  // The sign of the permutation times the signs of the axes: -1 for a left-handed host.
  const bool even = (made.axis[1] + 3 - made.axis[0]) % 3 == 1;
  made.mirrored = (even ? 1 : -1) * made.sign[0] * made.sign[1] * made.sign[2] < 0;
  *space = made;
  return true;
}

Affine FromHost(const Space& space, const Affine& host) {
  Affine matrix;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      const double value = space.sign[r] * host.m[space.axis[r]][space.converts_joints ? space.axis[c] : c];
      matrix.m[r][c] = space.converts_joints ? value * space.sign[c] : value;
    }
    matrix.m[r][3] = space.sign[r] * host.m[space.axis[r]][3] * space.metres_per_unit;
  }
  return matrix;
}

Affine JointToHost(const Space& space, const Affine& matrix) {
  Affine host;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) host.m[space.axis[r]][space.axis[c]] = space.sign[r] * space.sign[c] * matrix.m[r][c];
    host.m[space.axis[r]][3] = space.sign[r] * matrix.m[r][3] / space.metres_per_unit;
  }
  return host;
}

void VectorFromHost(const Space& space, const float (&host)[3], double (&vector)[3]) {
  for (int r = 0; r < 3; ++r)
    vector[r] = space.sign[r] * static_cast<double>(host[space.axis[r]]) * space.metres_per_unit;
}

Affine ToHost(const Space& space, const Affine& matrix) {
  Affine host;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) host.m[space.axis[r]][c] = space.sign[r] * matrix.m[r][c] / space.metres_per_unit;
  }
  return host;
}

}  // namespace dcloth::engine
