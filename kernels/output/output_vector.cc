// Four vertices at a time where they lie tight, which is how the garment's scratch lies and most hosts' buffers.
#include "kernels/simd.h"

#include "kernels/half.h"
#include "kernels/output/output.h"
#include "kernels/output/tangents.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/output/output_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kGroup = 4;
constexpr size_t kTight = 3 * sizeof(float);

// The least and greatest of one axis.
struct Extent {
  float low, high;

  void Add(float value) {
    low = value < low ? value : low;
    high = value > high ? value : high;
  }
};

template <class D, class V = hn::Vec<D>>
HWY_INLINE void AddLanes(D d, V low, V high, Extent* extent) {
  HWY_ALIGN float lows[kGroup], highs[kGroup];
  hn::Store(low, d, lows);
  hn::Store(high, d, highs);
  for (size_t i = 0; i < kGroup; ++i) {
    extent->low = lows[i] < extent->low ? lows[i] : extent->low;
    extent->high = highs[i] > extent->high ? highs[i] : extent->high;
  }
}

// Moves whole groups of tight positions; returns the vertices done.
HWY_INLINE size_t MoveGroups(const MoveJob& job, Extent (&extents)[3]) {
  const hn::CappedTag<float, kGroup> d;
  using V = hn::Vec<decltype(d)>;
  const V ox = hn::Set(d, job.origin[0]), oy = hn::Set(d, job.origin[1]), oz = hn::Set(d, job.origin[2]);
  V low[3], high[3];
  for (size_t c = 0; c < 3; ++c) {
    low[c] = hn::Set(d, kEmptyBound);
    high[c] = hn::Set(d, -kEmptyBound);
  }
  size_t i = 0;
  for (; i + kGroup <= job.vertices; i += kGroup) {
    V x, y, z;
    hn::LoadInterleaved3(d, job.positions + 3 * i, x, y, z);
    x = hn::Add(x, ox);
    y = hn::Add(y, oy);
    z = hn::Add(z, oz);
    hn::StoreInterleaved3(x, y, z, d, job.positions + 3 * i);
    const V moved[3] = {x, y, z};
    for (size_t c = 0; c < 3; ++c) {  // false for NaN
      low[c] = hn::IfThenElse(hn::Lt(moved[c], low[c]), moved[c], low[c]);
      high[c] = hn::IfThenElse(hn::Gt(moved[c], high[c]), moved[c], high[c]);
    }
  }
  for (size_t c = 0; c < 3; ++c) AddLanes(d, low[c], high[c], &extents[c]);
  return i;
}

// HalfFromFloat of four floats, as 32-bit integers; see half.h.
template <class D>
HWY_INLINE hn::Vec<hn::RebindToUnsigned<D>> HalvesOf(D d, hn::Vec<D> value) {
  const hn::RebindToUnsigned<D> du;
  const auto set = [&](uint32_t bits) { return hn::Set(du, bits); };
  const auto bits = hn::BitCast(du, value);
  const auto magnitude = hn::And(bits, set(0x7FFFFFFFu));
  const auto sign = hn::And(hn::ShiftRight<16>(bits), set(0x8000u));
  // 13 bits go: half an ulp less one, plus the kept bit, rounds ties to even; a carry moves into the exponent.
  const auto odd = hn::And(hn::ShiftRight<13>(magnitude), set(1));
  const auto normal = hn::ShiftRight<13>(hn::Sub(hn::Add(hn::Add(magnitude, set(0xFFFu)), odd), set(112u << 23)));
  // Below 2^-14 halves are multiples of 2^-24, which is what a float next to 0.5 counts in.
  const auto small = hn::Add(hn::BitCast(d, magnitude), hn::Set(d, 0.5f));
  const auto subnormal = hn::Sub(hn::BitCast(du, small), set(0x3F000000u));
  auto half = hn::IfThenElse(hn::Lt(magnitude, set(0x38800000u)), subnormal, normal);
  half = hn::IfThenElse(hn::Gt(magnitude, set(0x477FEFFFu)), set(0x7C00u), half);
  half = hn::IfThenElse(hn::Gt(magnitude, set(0x7F800000u)), set(0x7E00u), half);
  return hn::Or(half, sign);
}

}  // namespace

void Move(const MoveJob& job) {
  Extent extents[3] = {{kEmptyBound, -kEmptyBound}, {kEmptyBound, -kEmptyBound}, {kEmptyBound, -kEmptyBound}};
  for (size_t i = job.stride_bytes == kTight ? MoveGroups(job, extents) : 0; i < job.vertices; ++i) {
    float* position = StridedAt(job.positions, job.stride_bytes, i);
    for (size_t c = 0; c < 3; ++c) {
      position[c] += job.origin[c];
      extents[c].Add(position[c]);
    }
  }
  for (size_t c = 0; c < 3 && job.bounds != nullptr; ++c) {
    job.bounds[c] = extents[c].low;
    job.bounds[3 + c] = extents[c].high;
  }
}

void StoreHalf(const StoreHalfJob& job) {
  const hn::CappedTag<float, kGroup> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  HWY_ALIGN uint32_t lanes[kGroup];
  const size_t count = job.vertices * job.elements;
  size_t vertex = 0, element = 0;
  const auto store = [&](uint32_t half) {
    StridedAt(job.to, job.stride_bytes, vertex)[element] = static_cast<uint16_t>(half);
    if (++element == job.elements) element = 0, ++vertex;
  };
  size_t i = 0;
  for (; i + kGroup <= count; i += kGroup) {
    hn::Store(HalvesOf(d, hn::LoadU(d, job.from + i)), du, lanes);
    for (size_t k = 0; k < kGroup; ++k) store(lanes[k]);
  }
  for (; i < count; ++i) store(HalfFromFloat(job.from[i]));
}

void Tangents(const TangentsJob& job) {
  ComputeTangents(job, [](float square) {
    const hn::CappedTag<float, 1> d;
    return hn::GetLane(hn::Sqrt(hn::Set(d, square)));
  });
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
