#include "engine/src/idle.h"

#include <cmath>
#include <cstddef>
#include <cstring>

#include "engine/src/displacement.h"

namespace dcloth::engine {
namespace {

// False for NaN.
bool AreNear(const float* a, const float* b, size_t count) {
  bool near = true;
  for (size_t i = 0; i < count; ++i) near &= std::fabs(a[i] - b[i]) <= kSettledMetres;
  return near;
}

bool IsSettled(const Cloth& cloth) {
  if (cloth.tick_count < 2) return false;
  const uint32_t now = cloth.newest, before = SlotBefore(cloth, 1);
  return AreNear(cloth.increments[now], cloth.increments[before], size_t{3} * cloth.model->static_stage.bone_count) &&
         (cloth.displacement[now] == nullptr ||
          AreNear(cloth.displacement[now], cloth.displacement[before], DisplacementFloats(*cloth.model)));
}

}  // namespace

bool IsStill(const Cloth& cloth, const Affine* pose) {
  bool still = true;
  for (size_t j = 0; j < cloth.model->joint_count; ++j) {
    for (int r = 0; r < 3; ++r) {
      const double* a = pose[j].m[r];
      const double* b = cloth.idle_pose[j].m[r];
      for (int c = 0; c < 3; ++c) still &= std::fabs(a[c] - b[c]) <= kStillAxes;
      still &= std::fabs(a[3] - b[3]) <= kStillMetres;
    }
  }
  return still;
}

void CountTickBegun(Cloth* cloth, const Affine* pose) {
  if (cloth->idle_ticks != 0 && IsStill(*cloth, pose)) return;
  cloth->idle_ticks = 0;
  std::memcpy(cloth->idle_pose, pose, cloth->model->joint_count * sizeof(Affine));
}

void CountTickDone(Cloth* cloth) {
  if (!IsSettled(*cloth)) {
    cloth->idle_ticks = 0;
  } else if (cloth->idle_ticks < kIdleTicks) {
    ++cloth->idle_ticks;
  }
}

}  // namespace dcloth::engine
