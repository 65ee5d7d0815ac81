// Layer norm, PReLU and the embedding of four vertices at a time: their horizontal sums share one tree of shuffles
// (21 operations for 8 vertices with 8 lanes, instead of 6 a vertex), and one square root and division serve all four.
#include "kernels/gsgru/gsgru.h"

#if defined(DCLOTH_KERNELS_GSGRU_GSGRU_NORM_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef DCLOTH_KERNELS_GSGRU_GSGRU_NORM_INL_H_
#undef DCLOTH_KERNELS_GSGRU_GSGRU_NORM_INL_H_
#else
#define DCLOTH_KERNELS_GSGRU_GSGRU_NORM_INL_H_
#endif

#include "hwy/highway.h"
#include "kernels/multiply_add-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Four = hn::Vec<hn::CappedTag<float, 4>>;

// Adds the 128-bit blocks of a vector.
template <class D>
HWY_INLINE Four FoldBlocks(D d, hn::Vec<D> v) {
  if constexpr (hn::MaxLanes(D()) <= 4) {
    (void)d;
    return v;
  } else {
    const hn::Half<D> dh;
    return FoldBlocks(dh, hn::Add(hn::LowerHalf(dh, v), hn::UpperHalf(dh, v)));
  }
}

// {sum a, sum b, sum c, sum e}
template <class D>
HWY_INLINE Four SumFour(D d, hn::Vec<D> a, hn::Vec<D> b, hn::Vec<D> c, hn::Vec<D> e) {
  const hn::Repartition<uint64_t, D> d64;
  const auto ab = hn::BitCast(d64, hn::Add(hn::InterleaveLower(d, a, b), hn::InterleaveUpper(d, a, b)));
  const auto ce = hn::BitCast(d64, hn::Add(hn::InterleaveLower(d, c, e), hn::InterleaveUpper(d, c, e)));
  const auto lower = hn::BitCast(d, hn::InterleaveLower(d64, ab, ce));
  const auto upper = hn::BitCast(d, hn::InterleaveUpper(d64, ab, ce));
  return FoldBlocks(d, hn::Add(lower, upper));
}

// o: four rows of F; the first `count` of them become rows `vertex`.. of next x, or of s.
template <class D>
HWY_INLINE void NormFour(D d, const GsgruJob& job, float* HWY_RESTRICT o, size_t vertex, size_t count) {
  using V = hn::Vec<D>;
  const hn::CappedTag<float, 4> d4;
  const size_t width = job.features;
  const auto inverse_width = hn::Set(d4, 1.0f / static_cast<float>(width));
  HWY_ALIGN float means[4];
  HWY_ALIGN float inverses[4];

  V sum[4];
  for (size_t v = 0; v < 4; ++v) sum[v] = hn::Zero(d);
  for (size_t f = 0; f < width; f += hn::Lanes(d)) {
    for (size_t v = 0; v < 4; ++v) sum[v] = hn::Add(sum[v], hn::Load(d, o + v * width + f));
  }
  hn::Store(hn::Mul(SumFour(d, sum[0], sum[1], sum[2], sum[3]), inverse_width), d4, means);

  V mean[4];
  for (size_t v = 0; v < 4; ++v) mean[v] = hn::Set(d, means[v]);
  for (size_t v = 0; v < 4; ++v) sum[v] = hn::Zero(d);
  for (size_t f = 0; f < width; f += hn::Lanes(d)) {
    for (size_t v = 0; v < 4; ++v) {
      const V centred = hn::Sub(hn::Load(d, o + v * width + f), mean[v]);
      sum[v] = MultiplyAdd(centred, centred, sum[v]);
    }
  }
  const auto variance = hn::Mul(SumFour(d, sum[0], sum[1], sum[2], sum[3]), inverse_width);
  const auto deviation = hn::Sqrt(hn::Add(variance, hn::Set(d4, kGsgruEpsilon)));
  hn::Store(hn::Div(hn::Set(d4, 1.0f), deviation), d4, inverses);

  V inverse[4];
  for (size_t v = 0; v < 4; ++v) inverse[v] = hn::Set(d, inverses[v]);
  for (size_t v = 0; v < 4; ++v) sum[v] = hn::Zero(d);
  const V slope = hn::Set(d, job.prelu_slope);
  for (size_t f = 0; f < width; f += hn::Lanes(d)) {
    const V gain = hn::Load(d, job.norm_gain + f);
    const V offset = hn::Load(d, job.norm_offset + f);
    const V embed = job.embed != nullptr ? hn::Load(d, job.embed + f) : hn::Zero(d);
    for (size_t v = 0; v < 4; ++v) {
      const V normed = hn::Mul(hn::Sub(hn::Load(d, o + v * width + f), mean[v]), inverse[v]);
      const V y = MultiplyAdd(normed, gain, offset);
      const V next = MultiplyAdd(slope, hn::Min(y, hn::Zero(d)), hn::Max(y, hn::Zero(d)));
      if (job.embed != nullptr) {
        sum[v] = MultiplyAdd(next, embed, sum[v]);
      } else if (v < count) {
        hn::Store(next, d, job.next_x + (vertex + v) * width + f);
      }
    }
  }
  if (job.embed != nullptr) {
    const auto s = hn::Add(SumFour(d, sum[0], sum[1], sum[2], sum[3]), hn::Set(d4, job.embed_bias));
    hn::Store(s, d4, means);
    for (size_t v = 0; v < count; ++v) job.s[vertex + v] = means[v];
  }
}

// A block's `count` rows of o; apart as AggregateBlock is.
template <class D>
HWY_NOINLINE void NormBlock(D d, const GsgruJob& job, float* o, size_t first, size_t count) {
  for (size_t v = 0; v < count; v += 4) {
    NormFour(d, job, o + v * job.features, first + v, HWY_MIN(size_t{4}, count - v));
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_NORM_INL_H_
