// Exact sums of products of int8 weights and 16-bit inputs, by what each instruction set multiplies best. Weights are
// widened to 16 bits once a call. Included once per instruction set.
//
//   x86, WebAssembly   two rows at once: pmaddwd and its like, with AVX-512 one instruction that adds too (VNNI)
//   Arm                one row: smlal
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

constexpr size_t kRows = HWY_ARCH_ARM ? 1 : 2;

// As many weights as kRows rows of a vector's columns have.
template <class DI>
using WeightTag = hn::CappedTag<int16_t, kRows * hn::MaxLanes(DI())>;

// The inputs of kRows rows for every column.
template <class DI>
HWY_INLINE hn::Vec<WeightTag<DI>> Broadcast(const int16_t* x) {
#if HWY_ARCH_ARM
  return hn::Set(WeightTag<DI>(), *x);
#else
  int32_t pair;
  hwy::CopyBytes<sizeof(pair)>(x, &pair);
  return hn::BitCast(WeightTag<DI>(), hn::Set(DI(), pair));
#endif
}

// sum + the products of kRows rows, each lane a column.
template <class DI, class V = hn::Vec<DI>, class VW = hn::Vec<WeightTag<DI>>>
HWY_INLINE V AddRows([[maybe_unused]] DI di, V sum, VW w, VW x) {
#if HWY_ARCH_ARM
  return V(vmlal_s16(sum.raw, w.raw, x.raw));
#elif HWY_TARGET == HWY_AVX3 && !HWY_COMPILER_MSVC
  __asm__("vpdpwssd %2, %1, %0" : "+v"(sum.raw) : "v"(w.raw), "v"(x.raw));
  return sum;
#elif HWY_TARGET == HWY_AVX2 && !HWY_COMPILER_MSVC
  // GCC 12 keeps sums in two registers each, and copies.
  const __m256i products = _mm256_madd_epi16(w.raw, x.raw);
  __asm__("vpaddd %1, %0, %0" : "+x"(sum.raw) : "x"(products));
  return sum;
#elif HWY_TARGET == HWY_WASM
  return hn::Add(sum, V{wasm_i32x4_dot_i16x8(w.raw, x.raw)});
#else
  V unused = hn::Zero(di);  // x86 adds all into the first sum
  return hn::ReorderWidenMulAccumulate(di, w, x, sum, unused);
#endif
}

// acc[v][i] += the products of `rows` inputs (a multiple of kRows) of vertex v with vector i of the columns at
// `weights`. A vertex's inputs lie `rows` apart, steps of kRows rows `columns`.
template <class DI, size_t kVertices, size_t kVectors>
HWY_INLINE void AddProduct(DI di, const int16_t* HWY_RESTRICT x, size_t rows, const int16_t* HWY_RESTRICT weights,
                           size_t columns, hn::Vec<DI> (&acc)[kVertices][kVectors]) {
  const WeightTag<DI> dw;
  for (size_t k = 0; k < rows; k += kRows) {
    hn::Vec<WeightTag<DI>> w[kVectors];
    for (size_t i = 0; i < kVectors; ++i) w[i] = hn::Load(dw, weights + (k * columns + i * hn::Lanes(di) * kRows));
    for (size_t v = 0; v < kVertices; ++v) {
      const auto inputs = Broadcast<DI>(x + v * rows + k);
      for (size_t i = 0; i < kVectors; ++i) acc[v][i] = AddRows(di, acc[v][i], w[i], inputs);
    }
  }
}

// value, but not below `lowest`, which NaN becomes too.
template <class V>
HWY_INLINE V AtLeast(V value, V lowest) {
#if HWY_ARCH_X86
  return hn::Max(value, lowest);  // x86's maximum is its second operand where one of them is NaN
#else
  return hn::IfThenElse(hn::Gt(value, lowest), value, lowest);
#endif
}

// Rounds to nearest even, saturates to 16 bits and stores one vector of inputs. Above 2^22 the bits of a float still
// rise; below -2^22 their difference to the magic number's would wrap.
template <class D>
HWY_INLINE void StoreInputs(D d, hn::Vec<D> value, int16_t* to) {
  const hn::RebindToSigned<D> di;
  const hn::Rebind<int16_t, D> d16;
  value = AtLeast(value, hn::Set(d, -32768.0f));
  const auto rounded = hn::Sub(hn::BitCast(di, hn::Add(value, hn::Set(d, kRoundMagic))), hn::Set(di, kRoundMagicBits));
  hn::StoreU(hn::DemoteTo(d16, rounded), d16, to);
}

// Rows of `columns`, `stride` apart, to [rows / kRows][columns][kRows]; `rows` and `columns` are multiples of 8.
HWY_INLINE void PackWeights(const int8_t* HWY_RESTRICT flat, size_t stride, size_t rows, size_t columns,
                            int16_t* HWY_RESTRICT packed) {
  const hn::CappedTag<int8_t, 8> d8;
  const hn::CappedTag<int16_t, 8> dw;
  for (size_t k = 0; k < rows; k += kRows) {
    for (size_t c = 0; c < columns; c += 8) {
      const auto row = [&](size_t r) { return hn::PromoteTo(dw, hn::LoadU(d8, flat + (k + r) * stride + c)); };
      int16_t* to = packed + (k * columns + c * kRows);
      if constexpr (kRows == 1) {
        hn::StoreU(row(0), dw, to);
      } else {
        const auto first = row(0), second = row(1);
        hn::StoreU(hn::InterleaveLower(dw, first, second), dw, to);
        hn::StoreU(hn::InterleaveUpper(dw, first, second), dw, to + 8);
      }
    }
  }
}

}  // namespace dot
}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_I8_DOT_INL_H_
