// Normals with the square roots and divisions of four vertices at once. The scatter before it goes triangle by triangle
// (normals_accumulate.h says why), on x86 with AVX in vectors of a point.
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
constexpr size_t kTight = 3 * sizeof(float);

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

// The same for whole groups that lie tight: three vectors instead of twelve floats.
HWY_INLINE void NormaliseTight(float* n) {
  const hn::CappedTag<float, kGroup> d;
  hn::Vec<decltype(d)> x, y, z;
  hn::LoadInterleaved3(d, n, x, y, z);
  const auto squared = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
  const auto usable = hn::Ge(squared, hn::Set(d, kNormalsTiny));
  const auto inverse = hn::IfThenElseZero(usable, hn::Div(hn::Set(d, 1.0f), hn::Sqrt(squared)));
  const auto flat = hn::Eq(inverse, hn::Zero(d));
  hn::StoreInterleaved3(hn::IfThenZeroElse(flat, hn::Mul(x, inverse)),
                        hn::IfThenElse(flat, hn::Set(d, 1.0f), hn::Mul(y, inverse)),
                        hn::IfThenZeroElse(flat, hn::Mul(z, inverse)), d, n);
}

#if HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_AVX3
template <class V>
HWY_INLINE V Yzx(V v) {
  return V{_mm_permute_ps(v.raw, _MM_SHUFFLE(3, 0, 2, 1))};
}

// The scatter of normals_accumulate.h for tight arrays, its operations two and three at a time: 47 us against 59 for
// the skirt. A sum is added to in eight bytes and four: loads of twelve would wait for the stores of the triangle
// before. So would those of positions where normals follow on them: a buffer that holds both took 117 us against 71.
HWY_INLINE void AccumulateTight(const NormalsJob& job) {
  const hn::CappedTag<float, 4> d;
  const hn::CappedTag<float, 2> d2;
  const float* const positions = job.positions;
  float* const normals = job.normals;
  const auto position = [&](size_t vertex) { return hn::MaskedLoad(hn::FirstN(d, 3), d, positions + 3 * vertex); };
  for (size_t i = 0; i < 3 * job.vertices; ++i) normals[i] = 0.0f;
  const uint16_t* const end = job.triangles + 3 * job.triangle_count;
  for (const uint16_t* corner = job.triangles; corner != end; corner += 3) {
    const size_t corners[3] = {corner[0], corner[1], corner[2]};  // read once: vectors may alias
    const auto a = position(corners[0]);
    const auto u = hn::Sub(position(corners[1]), a), v = hn::Sub(position(corners[2]), a);
    const auto zxy = hn::Sub(hn::Mul(u, Yzx(v)), hn::Mul(Yzx(u), v));
    const auto xy = hn::LowerHalf(d2, Yzx(zxy));
    const float z = hn::GetLane(zxy);
    for (const size_t vertex : corners) {
      float* n = normals + 3 * vertex;
      hn::StoreU(hn::Add(hn::LoadU(d2, n), xy), d2, n);
      n[2] += z;
    }
  }
}

HWY_INLINE void Accumulate(const NormalsJob& job) {
  if (job.position_stride_bytes == kTight && job.normal_stride_bytes == kTight) return AccumulateTight(job);
  AccumulateAt<0, 0>(job);
}
#else
HWY_INLINE void Accumulate(const NormalsJob& job) { AccumulateNormals(job); }
#endif

}  // namespace

void Normals(const NormalsJob& job) {
  Accumulate(job);
  size_t i = 0;
  if (job.normal_stride_bytes == kTight) {
    for (; i + kGroup <= job.vertices; i += kGroup) NormaliseTight(job.normals + 3 * i);
  }
  for (; i + kGroup <= job.vertices; i += kGroup) NormaliseGroup(job, i, kGroup);
  if (i < job.vertices) NormaliseGroup(job, i, job.vertices - i);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
