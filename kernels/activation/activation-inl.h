// tanh and the logistic function on vectors, for the recurrent kernels. Included once per instruction set.
//
// tanh: tanh_rational.h. Maximum absolute error (measured against double, asserted by the test): 3.0e-7 with fused
// multiply-add, 4.2e-7 without. Odd, |tanh| <= 1, exactly +-1 from the clamp on. NaN gives NaN.
// Logistic function: (1 + tanh(x / 2)) / 2; half of tanh's error plus one rounding, exactly 0 and 1 from twice the clamp
// on. kFuse: multiply_add-inl.h.
#include "kernels/activation/tanh_rational.h"

#if defined(DCLOTH_KERNELS_ACTIVATION_ACTIVATION_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef DCLOTH_KERNELS_ACTIVATION_ACTIVATION_INL_H_
#undef DCLOTH_KERNELS_ACTIVATION_ACTIVATION_INL_H_
#else
#define DCLOTH_KERNELS_ACTIVATION_ACTIVATION_INL_H_
#endif

#include "hwy/highway.h"
#include "kernels/multiply_add-inl.h"

HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

template <bool kFuse = kFused, class D, class V = hn::Vec<D>>
HWY_INLINE V TanhOf(D d, V x) {
  const float clamp = kFuse ? kTanhClampWithFma : kTanhClampWithoutFma;
#if HWY_ARCH_ARM
  // NEON's minimum and maximum, as Highway uses them, return the number where one operand is NaN.
  x = hn::IfThenElse(hn::Lt(x, hn::Set(d, -clamp)), hn::Set(d, -clamp), x);
  x = hn::IfThenElse(hn::Gt(x, hn::Set(d, clamp)), hn::Set(d, clamp), x);
#else
  // x second: the x86 minimum and maximum return their second operand where one is NaN.
  x = hn::Min(hn::Set(d, clamp), hn::Max(hn::Set(d, -clamp), x));
#endif
  const V x2 = hn::Mul(x, x);
  V p = MultiplyAdd<kFuse>(x2, hn::Set(d, kTanhNumerator[6]), hn::Set(d, kTanhNumerator[5]));
  p = MultiplyAdd<kFuse>(x2, p, hn::Set(d, kTanhNumerator[4]));
  p = MultiplyAdd<kFuse>(x2, p, hn::Set(d, kTanhNumerator[3]));
  p = MultiplyAdd<kFuse>(x2, p, hn::Set(d, kTanhNumerator[2]));
  p = MultiplyAdd<kFuse>(x2, p, hn::Set(d, kTanhNumerator[1]));
  p = MultiplyAdd<kFuse>(x2, p, hn::Set(d, kTanhNumerator[0]));
  V q = MultiplyAdd<kFuse>(x2, hn::Set(d, kTanhDenominator[3]), hn::Set(d, kTanhDenominator[2]));
  q = MultiplyAdd<kFuse>(x2, q, hn::Set(d, kTanhDenominator[1]));
  q = MultiplyAdd<kFuse>(x2, q, hn::Set(d, kTanhDenominator[0]));
  return hn::Div(hn::Mul(x, p), q);
}

template <bool kFuse = kFused, class D, class V = hn::Vec<D>>
HWY_INLINE V SigmoidOf(D d, V x) {
  const V half = hn::Set(d, 0.5f);
  return MultiplyAdd<kFuse>(half, TanhOf<kFuse>(d, hn::Mul(half, x)), half);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // DCLOTH_KERNELS_ACTIVATION_ACTIVATION_INL_H_
