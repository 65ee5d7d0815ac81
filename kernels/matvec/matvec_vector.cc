// Matrix-vector products, one panel of 32 columns at a time in registers. A panel is one contiguous stream of weights;
// cold streams (the weights do not stay in cache inside a game) are what decides, hence the prefetch.
//
// Rejected (kernels/README.md has the figures): reading parts of a panel, or panels, side by side; 256-bit vectors for
// halves where 512-bit ones exist.
#include "kernels/simd.h"

#include "kernels/matvec/matvec.h"
#include "kernels/prefetch.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/matvec/matvec_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
#include "kernels/multiply_add-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;

const hn::ScalableTag<float> df;
using VF = hn::Vec<decltype(df)>;
constexpr size_t kLanes = HWY_LANES(float);
constexpr size_t kVectors = kPanelColumns / kLanes;
// Rows in flight, so that at least eight multiply-add chains hide the latency of one (4 cycles, two a cycle).
constexpr size_t kRows = kVectors >= 8 ? 1 : 8 / kVectors;
constexpr bool kAlwaysInOrder = kRows == 1 && !kFused;

// Asks for lines 96 rows ahead, into L2: of float32 every second one, as the hardware fetches a line's neighbour (and
// stops at a page's end); of halves and integers, half as far ahead in bytes, every one, without which an Intel Xeon
// takes a fifth more with cold weights. Every line into L1 costs a Zen 4 a fifth of its time with warm weights, and an
// eighth with cold ones. `row` is row `r` of an unrolled step. A prefetch may run past the end of the weights (it never
// faults), a pointer may not: hence the integer.
template <size_t kRowBytes>
HWY_INLINE void PrefetchAhead(const void* row, size_t r) {
  constexpr size_t kAheadBytes = 96 * kRowBytes, kEveryBytes = kRowBytes;
  static_assert(kEveryBytes == 64 || kEveryBytes == 128, "a line or two");
  if (r * kRowBytes % kEveryBytes != 0) return;
  DCLOTH_PREFETCH(reinterpret_cast<const char*>(reinterpret_cast<uintptr_t>(row) + kAheadBytes));
}

HWY_INLINE VF LoadWeights(const float* p) { return hn::Load(df, p); }
HWY_INLINE VF LoadWeights(const uint16_t* p) {
  const hn::Rebind<hwy::float16_t, decltype(df)> dh;
  return hn::PromoteTo(df, hn::Load(dh, reinterpret_cast<const hwy::float16_t*>(p)));
}

// Adds the bias, clamps and stores a vector of an output.
template <class Job>
HWY_INLINE void Finish(const Job& job, float* out, size_t column, VF y) {
  if (job.bias != nullptr) y = hn::Add(y, hn::LoadU(df, job.bias + column));
  if (job.relu) y = hn::Max(y, hn::Zero(df));
  hn::StoreU(y, df, out + column);
}

template <class Weight, bool kInOrder, class Job>
HWY_INLINE void MatvecFloat(const Job& job) {
  constexpr size_t kRowBytes = kPanelColumns * sizeof(Weight), kSums = kInOrder ? 1 : kRows;
  constexpr size_t kStep = HWY_MAX(kSums, size_t{2});  // rows unrolled, so that every second line is one of two rows
  constexpr bool kFuse = kFused && !kInOrder;
  for (size_t panel = 0; panel < job.panel_count; ++panel) {
    const Weight* weights = job.weights + panel * job.panel_rows * kPanelColumns;
    VF sum[kSums][kVectors];
    for (size_t r = 0; r < kSums; ++r) {
      for (size_t i = 0; i < kVectors; ++i) sum[r][i] = hn::Zero(df);
    }
    size_t j = 0;
    for (; j + kStep <= job.row_count; j += kStep) {
      for (size_t r = 0; r < kStep; ++r) {
        const Weight* row = weights + (j + r) * kPanelColumns;
        PrefetchAhead<kRowBytes>(row, r);
        const VF x = hn::Set(df, job.x[j + r]);
        for (size_t i = 0; i < kVectors; ++i) {
          VF& s = sum[r % kSums][i];
          s = MultiplyAdd<kFuse>(x, LoadWeights(row + i * kLanes), s);
        }
      }
    }
    for (; j < job.row_count; ++j) {
      const VF x = hn::Set(df, job.x[j]);
      for (size_t i = 0; i < kVectors; ++i) {
        sum[0][i] = MultiplyAdd<kFuse>(x, LoadWeights(weights + j * kPanelColumns + i * kLanes), sum[0][i]);
      }
    }
    for (size_t i = 0; i < kVectors; ++i) {
      VF y = sum[0][i];
      for (size_t r = 1; r < kSums; ++r) y = hn::Add(y, sum[r][i]);
      Finish(job, job.y, panel * kPanelColumns + i * kLanes, y);
    }
  }
}

// In order, a sum is one chain: what each scalar operation gives, whatever the width of the vectors.
template <class Weight, class Job>
HWY_INLINE void MatvecFloat(const Job& job) {
  kAlwaysInOrder || job.in_order ? MatvecFloat<Weight, true>(job) : MatvecFloat<Weight, false>(job);
}

}  // namespace

void MatvecF32(const MatvecF32Job& job) { MatvecFloat<float>(job); }
void MatvecF16(const MatvecF16Job& job) { MatvecFloat<uint16_t>(job); }

namespace {

const hn::RebindToSigned<decltype(df)> di;
const hn::Repartition<int16_t, decltype(df)> dw;
using VI = hn::Vec<decltype(di)>;
using VW = hn::Vec<decltype(dw)>;
constexpr size_t kPairBytes = 2 * kPanelColumns;  // two rows of a panel

// Vector `i` of the two rows at `row`: columns i * kLanes and on.
HWY_INLINE VW LoadPairs(const int8_t* row, size_t i) {
  const hn::Rebind<int8_t, decltype(dw)> db;
  return hn::PromoteTo(dw, hn::Load(db, row + i * 2 * kLanes));
}

HWY_INLINE VW SetPair(const int16_t* x) {
  int32_t pair;
  hwy::CopyBytes<sizeof(pair)>(x, &pair);
  return hn::BitCast(dw, hn::Set(di, pair));
}

// sum + the products of pairs of 16-bit numbers. x86 adds into `sum` alone; Arm splits a pair's products over two sums,
// so that only both together are the result. Highway 1.0.3 does not know AVX-512's one instruction for it (VNNI, which
// cpu.cc asks for): warm weights take up to a fifth less time than with two.
HWY_INLINE VI AddPairs(VW w, VW x, VI sum, VI& spare) {
#if HWY_TARGET == HWY_AVX3 && !HWY_COMPILER_MSVC
  (void)spare;
  __asm__("vpdpwssd %2, %1, %0" : "+v"(sum.raw) : "v"(w.raw), "v"(x.raw));
  return sum;
#elif HWY_TARGET == HWY_AVX2 && !HWY_COMPILER_MSVC
  (void)spare;  // GCC 12 keeps sums in two registers each, and copies
  const __m256i products = _mm256_madd_epi16(w.raw, x.raw);
  __asm__("vpaddd %1, %0, %0" : "+x"(sum.raw) : "x"(products));
  return sum;
#else
  return hn::ReorderWidenMulAccumulate(di, w, x, sum, spare);
#endif
}

// Sums that alternate: VNNI's latency is that of four of its products.
constexpr size_t kSums = HWY_TARGET == HWY_AVX3 ? 2 : 1;

}  // namespace

// A vector of pairs: columns c..c+kLanes, rows j and j+1; a 16-bit multiply-add (pmaddwd and its like) takes both rows.
// The integer sum is exact and the epilogue multiplies and adds apart, so every instruction set gives the same bits.
void MatvecI8(const MatvecI8Job& job) {
  const VF x_scale = hn::Set(df, job.x_scale);
  for (size_t panel = 0; panel < job.panel_count; ++panel) {
    const int8_t* weights = job.weights + panel * job.panel_rows * kPanelColumns;
    VI sum[kSums][kVectors], spare[kVectors];
    for (size_t i = 0; i < kVectors; ++i) spare[i] = hn::Zero(di);
    for (auto& set : sum) {
      for (VI& v : set) v = hn::Zero(di);
    }
    const auto add_pair = [&](size_t j, size_t r) {
      const int8_t* row = weights + j * kPanelColumns;
      PrefetchAhead<kPairBytes>(row, r);
      const auto x = SetPair(job.x + j);
      for (size_t i = 0; i < kVectors; ++i) {
        sum[r % kSums][i] = AddPairs(LoadPairs(row, i), x, sum[r % kSums][i], spare[i]);
      }
    };
    size_t j = 0;
    for (; j + 4 <= job.row_count; j += 4) {
      add_pair(j, 0);
      add_pair(j + 2, 1);
    }
    if (j < job.row_count) add_pair(j, 0);
    for (size_t i = 0; i < kVectors; ++i) {
      const size_t column = panel * kPanelColumns + i * kLanes;
      VI all = hn::RearrangeToOddPlusEven(sum[0][i], spare[i]);
      for (size_t other = 1; other < kSums; ++other) all = hn::Add(all, sum[other][i]);
      const VF total = hn::ConvertTo(df, all);
      Finish(job, job.y, column, hn::Mul(hn::Mul(total, x_scale), hn::Load(df, job.column_scales + column)));
    }
  }
}

namespace {

// The sums of kInputs inputs by kPartVectors vectors of a panel fill the registers: a vector of weights is widened once
// for all these inputs.
constexpr size_t kInputs = HWY_TARGET == HWY_AVX3 ? 8 : 4;
constexpr size_t kPartVectors = 2, kParts = kVectors / kPartVectors;

// Inputs `first` and on, columns `column` and on, whose weights are `part` and, two rows on, a kPairBytes further. Past
// the last input it computes that one again. Asks for a line at `ahead`, then `step` bytes on with every two rows.
HWY_INLINE void MatmulPart(const MatmulI8Job& job, const int8_t* part, size_t first, size_t column, uintptr_t ahead,
                           size_t step) {
  const auto input = [&](size_t b) { return HWY_MIN(first + b, job.count - 1); };
  const int16_t* x[kInputs];
  VI sum[kInputs][kPartVectors], spare[kInputs][kPartVectors];
  for (size_t b = 0; b < kInputs; ++b) {
    x[b] = job.x + input(b) * job.x_stride;
    for (size_t i = 0; i < kPartVectors; ++i) sum[b][i] = spare[b][i] = hn::Zero(di);
  }
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC unroll 2  // fewer moves between registers where there are 16
#endif
  for (size_t j = 0; j < job.row_count; j += 2) {
    DCLOTH_PREFETCH(reinterpret_cast<const char*>(ahead));
    ahead += step;
    VW w[kPartVectors];
    for (size_t i = 0; i < kPartVectors; ++i) w[i] = LoadPairs(part + j * kPanelColumns, i);
    for (size_t b = 0; b < kInputs; ++b) {
      const VW pair = SetPair(x[b] + j);
      for (size_t i = 0; i < kPartVectors; ++i) sum[b][i] = AddPairs(w[i], pair, sum[b][i], spare[b][i]);
    }
  }
  for (size_t b = 0; b < kInputs; ++b) {
    const VF x_scale = hn::Set(df, job.x_scales[input(b)]);
    for (size_t i = 0; i < kPartVectors; ++i) {
      const VF total = hn::ConvertTo(df, hn::RearrangeToOddPlusEven(sum[b][i], spare[b][i]));
      const VF scales = hn::Load(df, job.column_scales + column + i * kLanes);
      Finish(job, job.y + input(b) * job.y_stride, column + i * kLanes, hn::Mul(hn::Mul(total, x_scale), scales));
    }
  }
}

}  // namespace

// A panel's weights are used from L1 by all inputs, and the next panel's are asked for meanwhile, evenly: the products
// wait for arithmetic, not for memory.
void MatmulI8(const MatmulI8Job& job) {
  if (job.count == 0) return;
  const size_t passes = (job.count + kInputs - 1) / kInputs * kParts, step = (kPairBytes + passes - 1) / passes;
  for (size_t panel = 0; panel < job.panel_count; ++panel) {
    const int8_t* weights = job.weights + panel * job.panel_rows * kPanelColumns;
    auto ahead = reinterpret_cast<uintptr_t>(weights) + job.panel_rows * kPanelColumns;
    for (size_t first = 0; first < job.count; first += kInputs) {
      for (size_t part = 0; part < kParts; ++part) {
        const size_t offset = part * kPartVectors * kLanes;
        MatmulPart(job, weights + 2 * offset, first, panel * kPanelColumns + offset, ahead, step);
        ahead += step * (job.row_count / 2);
      }
    }
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
