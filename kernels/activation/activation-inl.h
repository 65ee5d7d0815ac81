// tanh and the logistic function on vectors, for the recurrent kernels. Included once per instruction set.
//
// tanh: tanh_rational.h. Maximum absolute error (measured against double, asserted by the test): 3.0e-7 with fused
// multiply-add, 4.2e-7 without. Odd, |tanh| <= 1, exactly +-1 from the clamp on. NaN gives NaN.
// Logistic function: (1 + tanh(x / 2)) / 2; half of tanh's error plus one rounding, exactly 0 and 1 from twice the
// clamp on. kFuse: multiply_add-inl.h.
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

// tanh(x) = x / q: x becomes the numerator. Step by step for all of them, so that each finds the last one's result
// ready.
template <bool kFuse, size_t kCount, class D, class V>
HWY_INLINE void TanhQuotients(D d, float clamp, V (&x)[kCount], V (&q)[kCount]) {
  const V lowest = hn::Set(d, -clamp), highest = hn::Set(d, clamp);
  V x2[kCount], p[kCount];
  for (size_t i = 0; i < kCount; ++i) {
#if HWY_ARCH_ARM
    // NEON's minimum and maximum, as Highway uses them, return the number where one operand is NaN.
    x[i] = hn::IfThenElse(hn::Lt(x[i], lowest), lowest, x[i]);
    x[i] = hn::IfThenElse(hn::Gt(x[i], highest), highest, x[i]);
#else
    // x second: the x86 minimum and maximum return their second operand where one is NaN.
    x[i] = hn::Min(highest, hn::Max(lowest, x[i]));
#endif
  }
  const auto step = [&](V(&sum)[kCount], float coefficient) {
    for (size_t i = 0; i < kCount; ++i) sum[i] = MultiplyAdd<kFuse>(x2[i], sum[i], hn::Set(d, coefficient));
  };
  for (size_t i = 0; i < kCount; ++i) x2[i] = hn::Mul(x[i], x[i]);
  for (size_t i = 0; i < kCount; ++i) p[i] = hn::Set(d, kTanhNumerator[6]);
  for (size_t i = 0; i < kCount; ++i) q[i] = hn::Set(d, kTanhDenominator[3]);
  step(p, kTanhNumerator[5]);
  step(q, kTanhDenominator[2]);
  step(p, kTanhNumerator[4]);
  step(q, kTanhDenominator[1]);
  step(p, kTanhNumerator[3]);
  step(q, kTanhDenominator[0]);
  step(p, kTanhNumerator[2]);
  step(p, kTanhNumerator[1]);
  step(p, kTanhNumerator[0]);
  for (size_t i = 0; i < kCount; ++i) x[i] = hn::Mul(x[i], p[i]);
}

template <bool kFuse = kFused, class D, class V = hn::Vec<D>>
HWY_INLINE V TanhOf(D d, V x) {
  V numerator[1] = {x}, denominator[1];
  TanhQuotients<kFuse>(d, kFuse ? kTanhClampWithFma : kTanhClampWithoutFma, numerator, denominator);
  return hn::Div(numerator[0], denominator[0]);
}

template <bool kFuse = kFused, class D, class V = hn::Vec<D>>
HWY_INLINE V SigmoidOf(D d, V x) {
  const V half = hn::Set(d, 0.5f);
  return MultiplyAdd<kFuse>(half, TanhOf<kFuse>(d, hn::Mul(half, x)), half);
}

// scale tanh(x) + offset of four vectors at a time, with one division instead of four. A number that is NaN makes its
// lane NaN in all four.
template <class D, class V = hn::Vec<D>>
HWY_INLINE void TanhOfFour(D d, float scale, float offset, V (&x)[4]) {
  V q[4];
  TanhQuotients<kFused>(d, kTanhClampShared, x, q);
  const V q01 = hn::Mul(q[0], q[1]), q23 = hn::Mul(q[2], q[3]);
  const V inverse = hn::Div(hn::Set(d, scale), hn::Mul(q01, q23));
  const V inverse01 = hn::Mul(inverse, q23), inverse23 = hn::Mul(inverse, q01);
  for (size_t i = 0; i < 4; ++i) x[i] = hn::Mul(x[i], q[i ^ 1]);
  for (size_t i = 0; i < 4; ++i) x[i] = MultiplyAdd(x[i], i < 2 ? inverse01 : inverse23, hn::Set(d, offset));
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE void SigmoidOfFour(D d, V (&x)[4]) {
  for (V& v : x) v = hn::Mul(v, hn::Set(d, 0.5f));
  TanhOfFour(d, 0.5f, 0.5f, x);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif  // DCLOTH_KERNELS_ACTIVATION_ACTIVATION_INL_H_
