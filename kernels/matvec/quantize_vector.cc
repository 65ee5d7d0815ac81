// QuantizeI16 on vectors. Maximum and integer sum do not depend on the order, every float operation is the scalar one:
// the result is that of the scalar reference to the bit.
#include "kernels/simd.h"

#include "kernels/matvec/matvec.h"
#include "kernels/matvec/quantize.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/matvec/quantize_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

template <class D>
HWY_INLINE hn::Vec<D> Product(D d, const QuantizeI16Job& job, size_t j) {
  auto v = hn::LoadU(d, job.x + j);
  if (job.row_scales != nullptr) v = hn::Mul(v, hn::LoadU(d, job.row_scales + j));
  return hn::IfThenElseZero(hn::Eq(hn::Sub(v, v), hn::Zero(d)), v);
}

template <class D>
HWY_INLINE hn::Vec<hn::RebindToSigned<D>> Round(D d, hn::Vec<D> v) {
  const hn::RebindToSigned<D> di;
  return hn::Sub(hn::BitCast(di, hn::Add(v, hn::Set(d, kRoundMagic))), hn::Set(di, kRoundMagicBits));
}

template <class D>
HWY_INLINE float MaxMagnitude(D d, const QuantizeI16Job& job, size_t begin, size_t end, float max) {
  auto v_max = hn::Set(d, max);
  for (size_t j = begin; j < end; j += hn::Lanes(d)) v_max = hn::Max(v_max, hn::Abs(Product(d, job, j)));
  return hn::GetLane(hn::MaxOfLanes(d, v_max));
}

// Quantises and returns sum|q|. A lane's sum stays in int32: at most 2^15 * kMaxQuantizedRows / lanes would not, so it
// is emptied every 2^15 vectors.
template <class D>
HWY_INLINE int64_t Quantize(D d, const QuantizeI16Job& job, size_t begin, size_t end, float inverse) {
  const hn::RebindToSigned<D> di;
  const hn::Rebind<int16_t, D> dw;
  const auto v_inverse = hn::Set(d, inverse);
  constexpr size_t kVectorsPerSum = size_t{1} << 15;
  int64_t total = 0;
  size_t j = begin;
  while (j < end) {
    auto sum = hn::Zero(di);
    for (size_t step = 0; step < kVectorsPerSum && j < end; ++step, j += hn::Lanes(d)) {
      const auto q = Round(d, hn::Mul(Product(d, job, j), v_inverse));
      sum = hn::Add(sum, hn::Abs(q));
      hn::StoreU(hn::DemoteTo(dw, q), dw, job.q + j);
    }
    HWY_ALIGN int32_t lanes[HWY_LANES(int32_t)];
    hn::Store(sum, di, lanes);
    for (size_t i = 0; i < hn::Lanes(d); ++i) total += lanes[i];
  }
  return total;
}

}  // namespace

void QuantizeI16(const QuantizeI16Job& job) {
  const hn::ScalableTag<float> d;
  const hn::CappedTag<float, 1> d1;
  const size_t whole = job.rows / hn::Lanes(d) * hn::Lanes(d);
  const float max = MaxMagnitude(d1, job, whole, job.rows, MaxMagnitude(d, job, 0, whole, 0.0f));
  const auto quantize = [&](float inverse) {
    return Quantize(d, job, 0, whole, inverse) + Quantize(d1, job, whole, job.rows, inverse);
  };
  float step = max > 0.0f ? QuantizedStep(max) : 1.0f;
  // Few rows never sum up to too much: then one pass is all.
  const int coarser = QuantizedCoarser(quantize(1.0f / step), job.rows);
  if (coarser != 0) {
    step *= PowerOfTwo(coarser);
    quantize(1.0f / step);
  }
  if (job.rows % 2 != 0) job.q[job.rows] = 0;
  *job.scale = step;
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
