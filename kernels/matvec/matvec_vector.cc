// Matrix-vector products, one panel of 32 columns at a time in registers. A panel is one contiguous stream of weights;
// cold streams (the weights do not stay in cache inside a game) are what decides, hence the prefetch.
#include "kernels/simd.h"

#include "kernels/matvec/matvec.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/matvec/matvec_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/cache_control.h"
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

// A prefetch may run past the end of the weights (it never faults), a pointer may not: hence the integer.
HWY_INLINE void PrefetchAhead(const void* p) {
#if HWY_ARCH_X86 || HWY_ARCH_ARM
  constexpr size_t kPrefetchBytes = 1536;
  hwy::Prefetch(reinterpret_cast<const char*>(reinterpret_cast<uintptr_t>(p) + kPrefetchBytes));
#else
  (void)p;
#endif
}

HWY_INLINE VF LoadWeights(const float* p) { return hn::Load(df, p); }
HWY_INLINE VF LoadWeights(const uint16_t* p) {
  const hn::Rebind<hwy::float16_t, decltype(df)> dh;
  return hn::PromoteTo(df, hn::Load(dh, reinterpret_cast<const hwy::float16_t*>(p)));
}

// Adds the bias, clamps and stores vector `i` of a panel.
template <class Job>
HWY_INLINE void Finish(const Job& job, size_t column, VF y) {
  if (job.bias != nullptr) y = hn::Add(y, hn::LoadU(df, job.bias + column));
  if (job.relu) y = hn::Max(y, hn::Zero(df));
  hn::StoreU(y, df, job.y + column);
}

template <class Weight, bool kInOrder, class Job>
HWY_INLINE void MatvecFloat(const Job& job) {
  constexpr size_t kRowBytes = kPanelColumns * sizeof(Weight), kSums = kInOrder ? 1 : kRows;
  constexpr bool kFuse = kFused && !kInOrder;
  for (size_t panel = 0; panel < job.panel_count; ++panel) {
    const Weight* weights = job.weights + (panel * job.panel_rows + job.row_begin) * kPanelColumns;
    VF sum[kSums][kVectors];
    for (size_t r = 0; r < kSums; ++r) {
      for (size_t i = 0; i < kVectors; ++i) sum[r][i] = hn::Zero(df);
    }
    size_t j = 0;
    for (; j + kSums <= job.row_count; j += kSums) {
      for (size_t r = 0; r < kSums; ++r) {
        const Weight* row = weights + (j + r) * kPanelColumns;
        for (size_t line = 0; line < kRowBytes; line += 64) PrefetchAhead(row + line / sizeof(Weight));
        const VF x = hn::Set(df, job.x[j + r]);
        for (size_t i = 0; i < kVectors; ++i) {
          sum[r][i] = MultiplyAdd<kFuse>(x, LoadWeights(row + i * kLanes), sum[r][i]);
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
      Finish(job, panel * kPanelColumns + i * kLanes, y);
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

// A vector of pairs: columns c..c+kLanes, rows j and j+1; a 16-bit multiply-add (pmaddwd and its like) takes both rows.
// The integer sum is exact and the epilogue multiplies and adds apart, so every instruction set gives the same bits.
void MatvecI8(const MatvecI8Job& job) {
  const hn::RebindToSigned<decltype(df)> di;
  const hn::Repartition<int16_t, decltype(df)> dw;
  const hn::Rebind<int8_t, decltype(dw)> db;
  using VI = hn::Vec<decltype(di)>;
  const VF x_scale = hn::Set(df, job.x_scale);
  for (size_t panel = 0; panel < job.panel_count; ++panel) {
    const int8_t* weights = job.weights + (panel * job.panel_rows + job.row_begin) * kPanelColumns;
    VI sum[kVectors], spare[kVectors];  // Arm splits a pair's products over two sums; x86 leaves `spare` zero
    for (size_t i = 0; i < kVectors; ++i) sum[i] = spare[i] = hn::Zero(di);
    for (size_t j = 0; j < job.row_count; j += 2) {
      const int8_t* row = weights + j * kPanelColumns;
      PrefetchAhead(row);
      int32_t pair;
      hwy::CopyBytes<sizeof(pair)>(job.x + j, &pair);
      const auto x = hn::BitCast(dw, hn::Set(di, pair));
      for (size_t i = 0; i < kVectors; ++i) {
        const auto w = hn::PromoteTo(dw, hn::Load(db, row + i * 2 * kLanes));
        sum[i] = hn::ReorderWidenMulAccumulate(di, w, x, sum[i], spare[i]);
      }
    }
    for (size_t i = 0; i < kVectors; ++i) {
      const size_t column = panel * kPanelColumns + i * kLanes;
      const VF total = hn::ConvertTo(df, hn::RearrangeToOddPlusEven(sum[i], spare[i]));
      Finish(job, column, hn::Mul(hn::Mul(total, x_scale), hn::Load(df, job.column_scales + column)));
    }
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
