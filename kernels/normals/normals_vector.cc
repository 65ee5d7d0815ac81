// Normals with the square roots and divisions of four vertices at once; the scatter before it stays scalar
// (normals_accumulate.h says why).
#include "kernels/simd.h"

#include "kernels/normals/normals.h"
#include "kernels/normals/normals_accumulate.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/normals/normals_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kGroup = 4;

HWY_INLINE void NormaliseGroup(const NormalsJob& job, size_t first, size_t count) {
  const hn::CappedTag<float, kGroup> d;
  HWY_ALIGN float lanes[kGroup] = {};
  for (size_t i = 0; i < count; ++i) {
    const float* n = NormalAt(job, first + i);
    lanes[i] = n[0] * n[0] + n[1] * n[1] + n[2] * n[2];
  }
  const auto squared = hn::Load(d, lanes);
  const auto usable = hn::Ge(squared, hn::Set(d, kNormalsTiny));
  // Zero marks a vertex without area, and is what the reciprocal root of infinity is.
  hn::Store(hn::IfThenElseZero(usable, hn::Div(hn::Set(d, 1.0f), hn::Sqrt(squared))), d, lanes);
  for (size_t i = 0; i < count; ++i) {
    float* n = NormalAt(job, first + i);
    const bool flat = lanes[i] == 0.0f;
    n[0] = flat ? 0.0f : n[0] * lanes[i];
    n[1] = flat ? 1.0f : n[1] * lanes[i];
    n[2] = flat ? 0.0f : n[2] * lanes[i];
  }
}

}  // namespace

void Normals(const NormalsJob& job) {
  AccumulateNormals(job);
  size_t i = 0;
  for (; i + kGroup <= job.vertices; i += kGroup) NormaliseGroup(job, i, kGroup);
  if (i < job.vertices) NormaliseGroup(job, i, job.vertices - i);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
