// a b + c: fused where the instruction set has it, else with a rounding in between. Included once per instruction set.
//
// kernels/split_vector.cc.in compiles the vector sources a second time with DCLOTH_SPLIT_MULTIPLY_ADD, which never
// fuses: with 128-bit vectors that is the arithmetic that every CPU with such vectors has, the "reproducible" table's.
#if defined(DCLOTH_KERNELS_MULTIPLY_ADD_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef DCLOTH_KERNELS_MULTIPLY_ADD_INL_H_
#undef DCLOTH_KERNELS_MULTIPLY_ADD_INL_H_
#else
#define DCLOTH_KERNELS_MULTIPLY_ADD_INL_H_
#endif

#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {

#if defined(DCLOTH_SPLIT_MULTIPLY_ADD)
constexpr bool kFused = false;
#else
constexpr bool kFused = HWY_NATIVE_FMA != 0;
#endif

// kFuse false: apart on every instruction set, for what must have the same bits on all of them.
template <bool kFuse = kFused, class V>
HWY_INLINE V MultiplyAdd(V a, V b, V c) {
  if constexpr (kFuse) {
    return hwy::HWY_NAMESPACE::MulAdd(a, b, c);
  } else {
    return hwy::HWY_NAMESPACE::Add(hwy::HWY_NAMESPACE::Mul(a, b), c);
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // DCLOTH_KERNELS_MULTIPLY_ADD_INL_H_
