// The graph-recurrent layer with lanes over vertices, where 16 lanes are more than a width fills: a block of 16
// vertices is one vector, feature by feature. Included once per instruction set.
//
// A weight is the multiply-add's own broadcast operand, and the layer norm needs no horizontal sum; rows are transposed
// on their way in and out. F 8, 7,952 vertices, a Xeon with AVX-512: 137 us a layer against 180 with AVX2's 8 lanes
// over features. A width known to the compiler (a tenth of a layer) and activations that share divisions (another)
// brought it there from 165. Rejected: the same for a first layer (8 KB for 13 us when cold), two and four blocks step
// by step (no gain), widths that are multiples of 16 (F 32 855 us against 720 on a Zen 5; F 16 327 against 375 here,
// for 12 KB).
#include <cstring>

#include "kernels/gsgru/gsgru.h"

#if defined(DCLOTH_KERNELS_GSGRU_GSGRU_OVER_VERTICES_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef DCLOTH_KERNELS_GSGRU_GSGRU_OVER_VERTICES_INL_H_
#undef DCLOTH_KERNELS_GSGRU_GSGRU_OVER_VERTICES_INL_H_
#else
#define DCLOTH_KERNELS_GSGRU_GSGRU_OVER_VERTICES_INL_H_
#endif

#include "hwy/highway.h"
#include "kernels/activation/activation-inl.h"
#include "kernels/gsgru/gsgru_mean-inl.h"
#include "kernels/multiply_add-inl.h"

#if HWY_TARGET == HWY_AVX3
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace over_vertices {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kLanes = kGsgruBlock;
constexpr size_t kColumns = 8;  // every width is a multiple of it
const hn::CappedTag<float, kLanes> d;
const hn::CappedTag<float, kLanes / 2> d8;
const hn::CappedTag<float, 4> d4;
using V = hn::Vec<decltype(d)>;
static_assert(hn::MaxLanes(d) == kLanes, "a block is one vector");

// Parts of the scratch, [F, 16] each.
struct Columns {
  float* mean;    // aggregated input, later o
  float* h;       // h, later h'
  float* update;  // the aggregated input's rows, then z, then the output's rows
  float* reset;   // r h
};

// In each 128-bit block, the 4 x 4 transposition.
HWY_INLINE void TransposeBlocks(V (&rows)[4]) {
  const V l0 = hn::InterleaveLower(d, rows[0], rows[2]), l1 = hn::InterleaveLower(d, rows[1], rows[3]);
  const V h0 = hn::InterleaveUpper(d, rows[0], rows[2]), h1 = hn::InterleaveUpper(d, rows[1], rows[3]);
  rows[0] = hn::InterleaveLower(d, l0, l1);
  rows[1] = hn::InterleaveUpper(d, l0, l1);
  rows[2] = hn::InterleaveLower(d, h0, h1);
  rows[3] = hn::InterleaveUpper(d, h0, h1);
}

// Rows [16, width] at `rows` to columns [width, 16]; width is a multiple of 4.
HWY_INLINE void ToColumns(const float* HWY_RESTRICT rows, size_t width, float* HWY_RESTRICT columns) {
  for (size_t f = 0; f < width; f += 4) {
    V v[4];
    for (size_t i = 0; i < 4; ++i) {
      const float* row = rows + i * width + f;
      const auto quarter = [&](size_t q) { return hn::Load(d4, row + 4 * q * width); };
      v[i] = hn::Combine(d, hn::Combine(d8, quarter(3), quarter(2)), hn::Combine(d8, quarter(1), quarter(0)));
    }
    TransposeBlocks(v);
    for (size_t i = 0; i < 4; ++i) hn::Store(v[i], d, columns + (f + i) * kLanes);
  }
}

// Columns [width, 16] to rows [16, width].
HWY_INLINE void ToRows(const float* HWY_RESTRICT columns, size_t width, float* HWY_RESTRICT rows) {
  for (size_t f = 0; f < width; f += 4) {
    V v[4];
    for (size_t i = 0; i < 4; ++i) v[i] = hn::Load(d, columns + (f + i) * kLanes);
    TransposeBlocks(v);
    for (size_t i = 0; i < 4; ++i) {
      float* row = rows + i * width + f;
      const auto low = hn::LowerHalf(d8, v[i]), high = hn::UpperHalf(d8, v[i]);
      hn::Store(hn::LowerHalf(d4, low), d4, row);
      hn::Store(hn::UpperHalf(d4, low), d4, row + 4 * width);
      hn::Store(hn::LowerHalf(d4, high), d4, row + 8 * width);
      hn::Store(hn::UpperHalf(d4, high), d4, row + 12 * width);
    }
  }
}

// acc[g][c] += sum over k of x[k] * weights[k * stride + g * group_stride + c].
template <size_t kGroups>
HWY_INLINE void AddProduct(const float* HWY_RESTRICT x, size_t rows, const float* HWY_RESTRICT weights, size_t stride,
                           size_t group_stride, V (&acc)[kGroups][kColumns]) {
  for (size_t k = 0; k < rows; ++k) {
    const V value = hn::Load(d, x + k * kLanes);
    for (size_t g = 0; g < kGroups; ++g) {
      for (size_t c = 0; c < kColumns; ++c) {
        acc[g][c] = MultiplyAdd(value, hn::Set(d, weights[k * stride + g * group_stride + c]), acc[g][c]);
      }
    }
  }
}

template <size_t kGroups>
HWY_INLINE void SetBias(const float* bias, size_t group_stride, V (&acc)[kGroups][kColumns]) {
  for (size_t g = 0; g < kGroups; ++g) {
    for (size_t c = 0; c < kColumns; ++c) acc[g][c] = hn::Set(d, bias[g * group_stride + c]);
  }
}

// z and r h.
HWY_INLINE void Gates(const GsgruJob& job, const Columns& at) {
  const size_t width = job.features;
  for (size_t f = 0; f < width; f += kColumns) {
    V acc[2][kColumns];
    SetBias(job.gate_bias + f, width, acc);
    AddProduct(at.mean, job.input_width, job.input_gates + f, 3 * width, width, acc);
    AddProduct(at.h, width, job.hidden_gates + f, 2 * width, width, acc);
    for (size_t c = 0; c < kColumns; c += 2) {
      V gates[4] = {acc[0][c], acc[0][c + 1], acc[1][c], acc[1][c + 1]};
      SigmoidOfFour(d, gates);
      for (size_t i = 0; i < 2; ++i) {
        const size_t column = (f + c + i) * kLanes;
        hn::Store(gates[i], d, at.update + column);
        hn::Store(hn::Mul(gates[2 + i], hn::Load(d, at.h + column)), d, at.reset + column);
      }
    }
  }
}

// h' in place.
HWY_INLINE void Update(const GsgruJob& job, const Columns& at) {
  const size_t width = job.features;
  for (size_t f = 0; f < width; f += kColumns) {
    V acc[1][kColumns];
    SetBias(job.gate_bias + 2 * width + f, 0, acc);
    AddProduct(at.mean, job.input_width, job.input_gates + 2 * width + f, 3 * width, 0, acc);
    AddProduct(at.reset, width, job.hidden_candidate + f, width, 0, acc);
    for (size_t c = 0; c < kColumns; c += 4) {
      V candidate[4] = {acc[0][c], acc[0][c + 1], acc[0][c + 2], acc[0][c + 3]};
      TanhOfFour(d, 1.0f, 0.0f, candidate);
      for (size_t i = 0; i < 4; ++i) {
        const size_t column = (f + c + i) * kLanes;
        const V old = hn::Load(d, at.h + column);
        const V step = hn::Sub(candidate[i], old);
        hn::Store(MultiplyAdd(hn::Load(d, at.update + column), step, old), d, at.h + column);
      }
    }
  }
}

// o, in place of the mean.
HWY_INLINE void Output(const GsgruJob& job, const Columns& at) {
  for (size_t f = 0; f < job.features; f += kColumns) {
    V acc[1][kColumns];
    SetBias(job.output_bias + f, 0, acc);
    AddProduct(at.h, job.features, job.output + f, job.features, 0, acc);
    for (size_t c = 0; c < kColumns; ++c) hn::Store(acc[0][c], d, at.mean + (f + c) * kLanes);
  }
}

// Layer norm, PReLU, and the embedding or next x; o is overwritten.
HWY_INLINE void Norm(const GsgruJob& job, float* HWY_RESTRICT o, size_t first, size_t count, float* HWY_RESTRICT rows) {
  const size_t width = job.features;
  const V inverse_width = hn::Set(d, 1.0f / static_cast<float>(width));
  V sum[4] = {hn::Zero(d), hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  const auto total = [&] { return hn::Add(hn::Add(sum[0], sum[1]), hn::Add(sum[2], sum[3])); };
  for (size_t f = 0; f < width; f += 4) {
    for (size_t i = 0; i < 4; ++i) sum[i] = hn::Add(sum[i], hn::Load(d, o + (f + i) * kLanes));
  }
  const V mean = hn::Mul(total(), inverse_width);
  for (V& s : sum) s = hn::Zero(d);
  for (size_t f = 0; f < width; f += 4) {
    for (size_t i = 0; i < 4; ++i) {
      const V centred = hn::Sub(hn::Load(d, o + (f + i) * kLanes), mean);
      sum[i] = MultiplyAdd(centred, centred, sum[i]);
    }
  }
  const V variance = MultiplyAdd(total(), inverse_width, hn::Set(d, kGsgruEpsilon));
  const V inverse = hn::Div(hn::Set(d, 1.0f), hn::Sqrt(variance));
  const V slope = hn::Set(d, job.prelu_slope), zero = hn::Zero(d);
  for (V& s : sum) s = zero;
  for (size_t f = 0; f < width; f += 4) {
    for (size_t i = 0; i < 4; ++i) {
      const V normed = hn::Mul(hn::Sub(hn::Load(d, o + (f + i) * kLanes), mean), inverse);
      const V y = MultiplyAdd(normed, hn::Set(d, job.norm_gain[f + i]), hn::Set(d, job.norm_offset[f + i]));
      const V next = MultiplyAdd(slope, hn::Min(y, zero), hn::Max(y, zero));
      if (job.embed != nullptr) {
        sum[i] = MultiplyAdd(next, hn::Set(d, job.embed[f + i]), sum[i]);
      } else {
        hn::Store(next, d, o + (f + i) * kLanes);
      }
    }
  }
  if (job.embed != nullptr) {
    hn::Store(hn::Add(total(), hn::Set(d, job.embed_bias)), d, rows);
    std::memcpy(job.s + first, rows, count * sizeof(float));
  } else if (count == kGsgruBlock) {
    ToRows(o, width, job.next_x + first * width);
  } else {
    ToRows(o, width, rows);
    std::memcpy(job.next_x + first * width, rows, count * width * sizeof(float));
  }
}

// A width known to the compiler unrolls the products; 0 takes the job's two. The copy lets it reach every stage.
template <size_t kWidth>
HWY_NOINLINE void RunLayer(const GsgruJob& caller_job) {
  GsgruJob job = caller_job;
  if (kWidth != 0) job.features = job.input_width = kWidth;
  const size_t width = job.features, tile = kGsgruBlock * width;
  const Columns at = {job.scratch, job.scratch + tile, job.scratch + 2 * tile, job.scratch + 3 * tile};
  for (size_t first = 0; first < job.vertices; first += kGsgruBlock) {
    const size_t count = HWY_MIN(kGsgruBlock, job.vertices - first), next = first + count;
    PrefetchBlock(job, next, HWY_MIN(kGsgruBlock, job.vertices - next));
    Aggregate(d8, job, first, count, at.update);
    ToColumns(at.update, GsgruInputStride(job.input_width), at.mean);
    ToColumns(job.state + first * width, width, at.h);
    Gates(job, at);
    Update(job, at);
    Output(job, at);
    ToRows(at.h, width, job.state + first * width);
    Norm(job, at.mean, first, count, at.update);
  }
}

}  // namespace over_vertices
}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // HWY_TARGET == HWY_AVX3

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_OVER_VERTICES_INL_H_
