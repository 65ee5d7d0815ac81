#include "engine/src/time/idle.h"

#include <cmath>
#include <cstddef>
#include <cstring>

#include "engine/src/base/arithmetic.h"
#include "engine/src/network/displacement.h"

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
  const format::ModelView& model = *cloth.model;
  if (RunsPatches(model, cloth.stages) && !ArePatchesAtRest(model.patch_stage, cloth.patches)) return false;
  const uint32_t now = cloth.newest, before = SlotBefore(cloth, 1);
  return AreNear(cloth.increments[now], cloth.increments[before], size_t{3} * model.static_stage.bone_count) &&
         (cloth.displacement[now] == nullptr ||
          AreNear(cloth.displacement[now], cloth.displacement[before], DisplacementFloats(model)));
}

size_t IncrementCount(const format::ModelView& model) { return size_t{3} * model.static_stage.bone_count; }

// The basis' coefficients of the newest tick; `count` of them, the others are zero.
const float* CauseOf(const Cloth& cloth, size_t* count) {
  const format::ModelView& model = *cloth.model;
  const bool skeleton = RunsSkeleton(model, cloth.stages);
  *count = skeleton ? DisplacementProduct(model, cloth.stages, cloth.coefficients, nullptr, nullptr).row_count : 0;
  return BasisCoefficients(model, cloth.coefficients);
}

void RememberStart(Cloth* cloth) {
  const format::ModelView& model = *cloth->model;
  const size_t increments = IncrementCount(model);
  size_t used = 0;
  const float* now = CauseOf(*cloth, &used);
  std::memcpy(cloth->idle_start, cloth->increments[cloth->newest], increments * sizeof(float));
  float* const c = cloth->idle_start + increments;
  std::memcpy(c, now, used * sizeof(float));
  std::memset(c + used, 0, (model.displacement.basis.rows - used) * sizeof(float));
}

// c times the basis, a few panels at a time.
bool BasisSumIsNear(const format::DisplacementView& view, const float* c, int16_t* quantized) {
  constexpr size_t kPanels = 16;
  const kernels::KernelTable& kernels = ActiveKernels();
  const size_t panels = kernels::PanelCount(view.basis.columns);
  const LinearProduct product = {&view.basis, c, view.basis.rows, Activation::kNone, quantized, nullptr};
  const InputScales scales = QuantizeInput(kernels, product);
  static constexpr float kOrigin[kPanels * kernels::kPanelColumns] = {};
  for (size_t begin = 0; begin < panels; begin += kPanels) {
    const size_t count = panels - begin < kPanels ? panels - begin : kPanels;
    alignas(64) float moved[kPanels * kernels::kPanelColumns];
    ApplyPanelsTo(kernels, product, scales, begin, count, moved);
    if (!AreNear(moved, kOrigin, count * kernels::kPanelColumns)) return false;
  }
  return true;
}

// How far each vertex has come. Spends what was remembered of the start.
bool DisplacementIsNearStart(Cloth* cloth) {
  const format::ModelView& model = *cloth->model;
  float* const c = cloth->idle_start + IncrementCount(model);
  size_t used = 0;
  const float* now = CauseOf(*cloth, &used);
  for (size_t row = 0; row < model.displacement.basis.rows; ++row) c[row] = (row < used ? now[row] : 0.0f) - c[row];
  return BasisSumIsNear(model.displacement, c, cloth->quantized);
}

bool IsNearStart(Cloth* cloth) {
  return AreNear(cloth->increments[cloth->newest], cloth->idle_start, IncrementCount(*cloth->model)) &&
         (cloth->model->displacement.basis.rows == 0 || DisplacementIsNearStart(cloth));
}

}  // namespace

size_t IdleStartFloats(const format::ModelView& model) { return IncrementCount(model) + model.displacement.basis.rows; }

bool IsStill(const Cloth& cloth, const Affine* pose) {
  bool still = true;
  if (ReadsWind(*cloth.model)) {
    double wind[3];
    VectorFromHost(cloth.rig.space, cloth.wind, wind);
    for (int r = 0; r < 3; ++r) still &= wind[r] == cloth.root.wind[r];
  }
  const double share = RunsPatches(*cloth.model, cloth.stages) ? kStillForPatches : 1;
  for (size_t j = 0; j < cloth.model->joint_count; ++j) {
    for (int r = 0; r < 3; ++r) {
      const double* a = pose[j].m[r];
      const double* b = cloth.idle_pose[j].m[r];
      for (int c = 0; c < 3; ++c) still &= std::fabs(a[c] - b[c]) <= share * kStillAxes;
      still &= std::fabs(a[3] - b[3]) <= share * kStillMetres;
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
    return;
  }
  if (IsFrozen(*cloth)) return;  // this tick was begun before
  if (cloth->idle_ticks == 0) RememberStart(cloth);
  if (++cloth->idle_ticks == kIdleTicks && !IsNearStart(cloth)) cloth->idle_ticks = 0;
}

}  // namespace dcloth::engine
