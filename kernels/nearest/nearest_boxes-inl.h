// Boxes around groups of sites: which may hold a site within some distance of a box of points. Lanes are groups.
#include "kernels/nearest/nearest.h"

#if defined(DCLOTH_KERNELS_NEAREST_NEAREST_BOXES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef DCLOTH_KERNELS_NEAREST_NEAREST_BOXES_INL_H_
#undef DCLOTH_KERNELS_NEAREST_NEAREST_BOXES_INL_H_
#else
#define DCLOTH_KERNELS_NEAREST_NEAREST_BOXES_INL_H_
#endif

#include "hwy/highway.h"
#include "kernels/multiply_add-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kMaxLanes = 16;
constexpr float kMore = 1.00001f;  // for the rounding of a difference of squares

const hn::CappedTag<float, kMaxLanes> d;
using V = hn::Vec<decltype(d)>;

HWY_INLINE uint32_t Bits(hn::Mask<decltype(d)> mask) {
  uint8_t bits[8] = {};
  hn::StoreMaskBits(d, mask, bits);
  return bits[0] | static_cast<uint32_t>(bits[1]) << 8;
}

HWY_INLINE V SquaredLength(V x, V y, V z) { return MultiplyAdd(x, x, MultiplyAdd(y, y, hn::Mul(z, z))); }

// Of all groups, by the row; padding lies at kNoGroup.
struct Boxes {
  const float* rows;
  size_t stride, count;
  HWY_INLINE V At(size_t row, size_t group) const { return hn::LoadU(d, rows + row * stride + group); }
  HWY_INLINE V All(size_t row, size_t group) const { return hn::Set(d, rows[row * stride + group]); }
};

HWY_INLINE Boxes BoxesOf(const NearestJob& job) { return {job.bounds, NearestBoundStride(job.groups), job.groups}; }

struct Box {
  V low[3], high[3];
};

// Between the ranges [low, high] and [from, to].
HWY_INLINE V Gap(V low, V high, V from, V to) {
  return hn::Max(hn::Max(hn::Sub(low, to), hn::Sub(from, high)), hn::Zero(d));
}
HWY_INLINE V Span(V low, V high, V from, V to) { return hn::Max(hn::Sub(high, from), hn::Sub(to, low)); }

// Of any point of `box` from any site of the groups from `at` on: at least, at most. Squared.
HWY_INLINE V Least(const Boxes& boxes, size_t at, const Box& box) {
  V gap[3];
  for (size_t c = 0; c < 3; ++c) gap[c] = Gap(boxes.At(kLow + c, at), boxes.At(kHigh + c, at), box.low[c], box.high[c]);
  return SquaredLength(gap[0], gap[1], gap[2]);
}
HWY_INLINE V Most(const Boxes& boxes, size_t at, const Box& box) {
  V span[3];
  for (size_t c = 0; c < 3; ++c)
    span[c] = Span(boxes.At(kLow + c, at), boxes.At(kHigh + c, at), box.low[c], box.high[c]);
  return SquaredLength(span[0], span[1], span[2]);
}

// The group all of whose box is nearest to all of `box`.
HWY_INLINE size_t NearestBox(const Boxes& boxes, const Box& box) {
  V least = hn::Set(d, 3e38f), first = hn::Zero(d), index = hn::Iota(d, 0.0f);
  const V step = hn::Set(d, static_cast<float>(hn::Lanes(d)));
  for (size_t at = 0; at < boxes.count; at += hn::Lanes(d)) {
    const V most = Most(boxes, at, box);
    first = hn::IfThenElse(hn::Lt(most, least), index, first);
    least = hn::Min(most, least);
    index = hn::Add(index, step);
  }
  const V best = hn::MinOfLanes(d, least);
  const V candidates = hn::IfThenElse(hn::Eq(least, best), first, hn::Set(d, 1e9f));
  const float found = hn::GetLane(hn::MinOfLanes(d, candidates));
  return found < static_cast<float>(boxes.count) ? static_cast<size_t>(found) : 0;
}

// Groups, in order.
struct List {
  uint16_t groups[kMaxNearestGroups];
  size_t count;
};

// Those that may hold a site within sqrt(`squared` + slack^2) of points of `box`. Returns their largest slack^2.
HWY_INLINE float ListWithin(const Boxes& boxes, float squared, const Box& box, List* list) {
  const V limit = hn::Set(d, squared), more = hn::Set(d, kMore);
  V most_slack = hn::Zero(d);
  list->count = 0;
  for (size_t at = 0; at < boxes.count; at += hn::Lanes(d)) {
    const V slack = boxes.At(kSlack, at);
    const auto within = hn::Le(Least(boxes, at, box), hn::Mul(hn::Add(limit, slack), more));
    most_slack = hn::Max(hn::IfThenElseZero(within, slack), most_slack);
    for (uint32_t left = Bits(within); left != 0; left &= left - 1) {
      const size_t found = at + hwy::Num0BitsBelowLS1Bit_Nonzero32(left);
      if (found >= boxes.count) break;  // padding, which points as far out as kNoGroup come near to
      list->groups[list->count++] = static_cast<uint16_t>(found);
    }
  }
  return hn::GetLane(hn::MaxOfLanes(d, most_slack));
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

#endif  // DCLOTH_KERNELS_NEAREST_NEAREST_BOXES_INL_H_
