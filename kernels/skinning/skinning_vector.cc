// Linear blend skinning with 128-bit vectors on every instruction set: a matrix row is one vector. Blending rows first
// and multiplying once costs 3 multiply-adds an influence; lanes over vertices would need 12 gathers an influence
// instead.
#include "kernels/simd.h"

#include "kernels/skinning/skinning.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/skinning/skinning_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/cache_control.h"
#include "hwy/highway.h"
#include "kernels/multiply_add-inl.h"
#include "kernels/prefetch.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

const hn::CappedTag<float, 4> d;
const hn::CappedTag<float, 2> d2;
using V = hn::Vec<decltype(d)>;

// Reads 16 bytes, of which the last four are the next vertex's: for every vertex but the last.
struct LoadFour {
  static HWY_INLINE V Load(const float* p) { return hn::LoadU(d, p); }
};

// Reads 12 bytes.
struct LoadThree {
  static HWY_INLINE V Load(const float* p) {
    HWY_ALIGN float lanes[4] = {p[0], p[1], p[2], 0.0f};
    return hn::Load(d, lanes);
  }
};

// [sum a, sum b, sum c, sum c]
HWY_INLINE V SumLanes(V a, V b, V c) {
  const V ab = hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b));
  const V cc = hn::Add(hn::InterleaveLower(d, c, c), hn::InterleaveUpper(d, c, c));
  return hn::Add(hn::ConcatLowerLower(d, cc, ab), hn::ConcatUpperUpper(d, cc, ab));
}

// Where slot `slot` of the output has its numbers.
HWY_INLINE size_t SourceOf(const SkinningJob& job, size_t slot) {
  return job.chosen == nullptr ? slot : job.chosen[slot];
}

template <size_t kInfluences, class Loader>
HWY_INLINE void SkinVertex(const SkinningJob& job, size_t slot, V blend) {
  const size_t i = SourceOf(job, slot);
  V p = Loader::Load(job.positions + 3 * i);
  if (job.delta0 != nullptr) {
    const V from = Loader::Load(job.delta0 + 3 * i);
    p = hn::Add(p, MultiplyAdd(blend, hn::Sub(Loader::Load(job.delta1 + 3 * i), from), from));
  }
  // The fourth lane takes the translation whatever was loaded there, NaN included.
  p = hn::IfThenElse(hn::FirstN(d, 3), p, hn::Set(d, 1.0f));

  const uint8_t* bones = job.bones + i * kInfluences;
  const float* weights = job.weights + i * kInfluences;
  V row0 = hn::Zero(d), row1 = hn::Zero(d), row2 = hn::Zero(d);
  for (size_t k = 0; k < kInfluences; ++k) {
    const float* matrix = job.matrices + size_t{12} * bones[k];
    const V weight = hn::Set(d, weights[k]);
    row0 = MultiplyAdd(weight, hn::LoadU(d, matrix), row0);
    row1 = MultiplyAdd(weight, hn::LoadU(d, matrix + 4), row1);
    row2 = MultiplyAdd(weight, hn::LoadU(d, matrix + 8), row2);
  }
  const V out = SumLanes(hn::Mul(row0, p), hn::Mul(row1, p), hn::Mul(row2, p));
  float* to = reinterpret_cast<float*>(reinterpret_cast<char*>(job.out) + slot * job.out_stride_bytes);
  hn::StoreU(hn::LowerHalf(d2, out), d2, to);
  to[2] = hn::GetLane(hn::UpperHalf(d2, out));
}

// Slots [first, end).
template <size_t kInfluences, class Loader>
HWY_NOINLINE void SkinRun(const SkinningJob& job, size_t first, size_t end) {
  const V blend = hn::Set(d, job.blend);
  for (size_t i = first; i < end; ++i) SkinVertex<kInfluences, Loader>(job, i, blend);
}

// Six arrays are more than prefetchers follow from page to page: of the skirt's size and with emptied caches 40 us
// instead of 51, warm 35 instead of 33 (AVX-512, a Xeon). 32, 128 and 256 vertices ahead are no different.
constexpr size_t kAhead = 64, kRun = 16;

HWY_INLINE void PrefetchRun(const void* array, size_t stride_bytes, size_t first, size_t count) {
  const char* bytes = static_cast<const char*>(array) + first * stride_bytes;
  const size_t step = HWY_MAX(size_t{64}, stride_bytes);
  for (size_t i = 0; i < count * stride_bytes; i += step) hwy::Prefetch(bytes + i);
}

using Run = void (*)(const SkinningJob& job, size_t first, size_t end);

HWY_NOINLINE void SkinAll(const SkinningJob& job, Run skin, Run skin_last) {
  if (job.vertices == 0) return;
  const size_t last = job.vertices - 1;
  for (size_t first = 0; first < last; first += kRun) {
    const size_t ahead = first + kAhead;
    if (ahead + kRun <= job.vertices) {
      const size_t from = SourceOf(job, ahead), count = SourceOf(job, ahead + kRun - 1) + 1 - from;
      PrefetchRun(job.positions, 3 * sizeof(float), from, count);
      if (job.delta0 != nullptr) {
        PrefetchRun(job.delta0, 3 * sizeof(float), from, count);
        PrefetchRun(job.delta1, 3 * sizeof(float), from, count);
      }
      PrefetchRun(job.bones, job.influences, from, count);
      PrefetchRun(job.weights, job.influences * sizeof(float), from, count);
      PrefetchRun(job.out, job.out_stride_bytes, ahead, kRun);
    }
    if (job.ahead != nullptr) PrefetchBytes(reinterpret_cast<uintptr_t>(job.ahead) + 12 * first, 12 * kRun);
    skin(job, first, HWY_MIN(first + kRun, last));
  }
  skin_last(job, last, job.vertices);
}

template <size_t kInfluences>
HWY_INLINE void SkinWith(const SkinningJob& job) {
  SkinAll(job, SkinRun<kInfluences, LoadFour>, SkinRun<kInfluences, LoadThree>);
}

}  // namespace

void Skinning(const SkinningJob& job) {
  switch (job.influences) {
    case 1:
      return SkinWith<1>(job);
    case 2:
      return SkinWith<2>(job);
    case 3:
      return SkinWith<3>(job);
    case 4:
      return SkinWith<4>(job);
    case 5:
      return SkinWith<5>(job);
    case 6:
      return SkinWith<6>(job);
    case 7:
      return SkinWith<7>(job);
    case 8:
      return SkinWith<8>(job);
    default:
      return;
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
