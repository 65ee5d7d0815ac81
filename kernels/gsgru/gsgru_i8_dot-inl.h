// Exact sums of int8 products, by what each instruction set multiplies best, and the order of weights that it wants. Included
// once per instruction set.
//
//   AVX-512   four rows at once, vpdpbusd: inputs as q + 128 (it takes one side unsigned), taken back by the start value
//   NEON      four rows at once: sdot where the build may use it (-march=armv8.2-a+dotprod, Apple's by default), else two
//             products in 16 bits (at most 2 * 128 * 127), then pairs into 32
//   others    two rows at once, pmaddwd and its like: both sides widened to 16 bits, weights once a call
#include "kernels/gsgru/gsgru_i8.h"

#if defined(DCLOTH_KERNELS_GSGRU_GSGRU_I8_DOT_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef DCLOTH_KERNELS_GSGRU_GSGRU_I8_DOT_INL_H_
#undef DCLOTH_KERNELS_GSGRU_GSGRU_I8_DOT_INL_H_
#else
#define DCLOTH_KERNELS_GSGRU_GSGRU_I8_DOT_INL_H_
#endif

#include "hwy/highway.h"
#include "kernels/matvec/quantize.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace dot {

namespace hn = hwy::HWY_NAMESPACE;

#if HWY_TARGET == HWY_AVX3 && !HWY_COMPILER_MSVC
#define DCLOTH_DOT_FOUR_ROWS 1
constexpr bool kUnsignedInputs = true;
using Input = uint8_t;
using Weight = int8_t;
#elif HWY_ARCH_ARM
#define DCLOTH_DOT_FOUR_ROWS 1
constexpr bool kUnsignedInputs = false;
using Input = int8_t;
using Weight = int8_t;
#else
#define DCLOTH_DOT_FOUR_ROWS 0
constexpr bool kUnsignedInputs = false;
using Input = int16_t;
using Weight = int16_t;
#endif
constexpr size_t kRows = DCLOTH_DOT_FOUR_ROWS ? 4 : 2;
static_assert(kRows * sizeof(Weight) == 4, "a vector of weights has as many columns as one of sums");

template <class DI>
using WeightTag = hn::Repartition<Weight, DI>;

// sum + the products of kRows rows, each lane a column. `x` holds the same kRows inputs in every lane.
template <class DI, class V = hn::Vec<DI>, class VW = hn::Vec<WeightTag<DI>>>
HWY_INLINE V AddRows([[maybe_unused]] DI di, V sum, VW w, V x) {
#if HWY_TARGET == HWY_AVX3 && !HWY_COMPILER_MSVC
  __asm__("vpdpbusd %2, %1, %0" : "+v"(sum.raw) : "v"(x.raw), "v"(w.raw));
  return sum;
#elif HWY_ARCH_ARM
  const int8x16_t inputs = hn::BitCast(WeightTag<DI>(), x).raw;
#if defined(__ARM_FEATURE_DOTPROD)
  return V(vdotq_s32(sum.raw, w.raw, inputs));
#else
  const int16x8_t low = vmull_s8(vget_low_s8(w.raw), vget_low_s8(inputs));
  const int16x8_t high = vmull_s8(vget_high_s8(w.raw), vget_high_s8(inputs));
#if HWY_ARCH_ARM_A64
  const int16x8_t pairs = vpaddq_s16(low, high);
#else
  const int16x8_t pairs = vcombine_s16(vpadd_s16(vget_low_s16(low), vget_high_s16(low)),
                                       vpadd_s16(vget_low_s16(high), vget_high_s16(high)));
#endif
  return V(vpadalq_s16(sum.raw, pairs));
#endif
#elif HWY_TARGET == HWY_WASM
  return hn::Add(sum, V{wasm_i32x4_dot_i16x8(w.raw, hn::BitCast(WeightTag<DI>(), x).raw)});
#elif HWY_TARGET == HWY_AVX2 && !HWY_COMPILER_MSVC
  // GCC 12 keeps sums in two registers each, and copies.
  const __m256i products = _mm256_madd_epi16(w.raw, hn::BitCast(WeightTag<DI>(), x).raw);
  __asm__("vpaddd %1, %0, %0" : "+x"(sum.raw) : "x"(products));
  return sum;
#else
  V unused = hn::Zero(di);  // x86 adds all into the first sum
  return hn::ReorderWidenMulAccumulate(di, w, hn::BitCast(WeightTag<DI>(), x), sum, unused);
#endif
}

// acc[v][i] += the products of `rows` inputs (a multiple of kRows) of vertex v with vector i of the columns at `weights`.
// A vertex's inputs lie `rows` apart, steps of kRows rows `columns`.
template <class DI, size_t kVertices, size_t kVectors>
HWY_INLINE void AddProduct(DI di, const Input* HWY_RESTRICT x, size_t rows, const Weight* HWY_RESTRICT weights,
                           size_t columns, hn::Vec<DI> (&acc)[kVertices][kVectors]) {
  const WeightTag<DI> dw;
  for (size_t k = 0; k < rows; k += kRows) {
    hn::Vec<WeightTag<DI>> w[kVectors];
    for (size_t i = 0; i < kVectors; ++i) w[i] = hn::Load(dw, weights + (k * columns + i * hn::Lanes(di) * kRows));
    for (size_t v = 0; v < kVertices; ++v) {
      int32_t inputs;
      hwy::CopyBytes<sizeof(inputs)>(x + v * rows + k, &inputs);
      const auto all = hn::Set(di, inputs);
      for (size_t i = 0; i < kVectors; ++i) acc[v][i] = AddRows(di, acc[v][i], w[i], all);
    }
  }
}

// Rounds to nearest even, saturates to int8 and stores one vector of inputs.
template <class D>
HWY_INLINE void StoreInputs(D d, hn::Vec<D> value, Input* to) {
  const hn::RebindToSigned<D> di;
  const auto rounded =
      hn::Sub(hn::BitCast(di, hn::Add(value, hn::Set(d, kRoundMagic))), hn::Set(di, kRoundMagicBits));
#if DCLOTH_DOT_FOUR_ROWS
  const hn::Rebind<int8_t, D> d8;
  auto q = hn::DemoteTo(d8, rounded);
  if (kUnsignedInputs) q = hn::Xor(q, hn::Set(d8, int8_t{-128}));
  hn::StoreU(q, d8, reinterpret_cast<int8_t*>(to));
#else
  const hn::Rebind<int16_t, D> d16;
  const auto q = hn::DemoteTo(d16, rounded);
  hn::StoreU(hn::Min(hn::Max(q, hn::Set(d16, int16_t{-128})), hn::Set(d16, int16_t{127})), d16, to);
#endif
}

// Rows of `columns`, `stride` apart, to [rows / kRows][columns][kRows]; `rows` and `columns` are multiples of 8.
HWY_INLINE void PackWeights(const int8_t* HWY_RESTRICT flat, size_t stride, size_t rows, size_t columns,
                            Weight* HWY_RESTRICT packed) {
  const hn::CappedTag<int8_t, 8> d8;
  const hn::CappedTag<int8_t, 16> d16;
  for (size_t k = 0; k < rows; k += kRows) {
    for (size_t c = 0; c < columns; c += 8) {
      hn::Vec<decltype(d16)> row[kRows];
      for (size_t r = 0; r < kRows; ++r) {
        row[r] = hn::ZeroExtendVector(d16, hn::LoadU(d8, flat + (k + r) * stride + c));
      }
      Weight* to = packed + k * columns + c * kRows;
#if DCLOTH_DOT_FOUR_ROWS
      const hn::CappedTag<int16_t, 8> dw;
      const auto first = hn::BitCast(dw, hn::InterleaveLower(d16, row[0], row[1]));
      const auto second = hn::BitCast(dw, hn::InterleaveLower(d16, row[2], row[3]));
      hn::StoreU(hn::BitCast(d16, hn::InterleaveLower(dw, first, second)), d16, to);
      hn::StoreU(hn::BitCast(d16, hn::InterleaveUpper(dw, first, second)), d16, to + 16);
#else
      HWY_ALIGN int8_t pairs[16];
      hn::Store(hn::InterleaveLower(d16, row[0], row[1]), d16, pairs);
      const hn::CappedTag<int16_t, 8> dw;
      hn::StoreU(hn::PromoteTo(dw, hn::Load(d8, pairs)), dw, to);
      hn::StoreU(hn::PromoteTo(dw, hn::Load(d8, pairs + 8)), dw, to + 8);
#endif
    }
  }
}

// What sums of packed weights start from: minus what inputs larger by 128 add.
template <class DI>
HWY_INLINE void StartSums(DI di, const Weight* packed, size_t rows, size_t columns, int32_t* HWY_RESTRICT start) {
  const WeightTag<DI> dw;
  const auto offset = hn::Set(di, static_cast<int32_t>(0x80808080u));
  for (size_t c = 0; c < columns; c += hn::Lanes(di)) {
    auto sum = hn::Zero(di);
    if (kUnsignedInputs) {
      for (size_t k = 0; k < rows; k += kRows) {
        sum = AddRows(di, sum, hn::Load(dw, packed + k * columns + c * kRows), offset);
      }
    }
    hn::Store(hn::Neg(sum), di, start + c);
  }
}

}  // namespace dot
}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_I8_DOT_INL_H_
