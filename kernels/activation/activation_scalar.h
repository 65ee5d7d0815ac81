// tanh and the logistic function as the kernels compute them, for the scalar references. Formula and errors:
// activation-inl.h.
#ifndef DCLOTH_KERNELS_ACTIVATION_ACTIVATION_SCALAR_H_
#define DCLOTH_KERNELS_ACTIVATION_ACTIVATION_SCALAR_H_

#include "kernels/activation/tanh_rational.h"

namespace dcloth::kernels::scalar {

inline float TanhOf(float x) {
  x = x < -kTanhClampWithoutFma ? -kTanhClampWithoutFma : x > kTanhClampWithoutFma ? kTanhClampWithoutFma : x;
  const float x2 = x * x;
  float p = kTanhNumerator[6];
  for (int i = 5; i >= 0; --i) p = x2 * p + kTanhNumerator[i];
  float q = kTanhDenominator[3];
  for (int i = 2; i >= 0; --i) q = x2 * q + kTanhDenominator[i];
  return x * p / q;
}

inline float SigmoidOf(float x) { return 0.5f * TanhOf(0.5f * x) + 0.5f; }

}  // namespace dcloth::kernels::scalar

#endif  // DCLOTH_KERNELS_ACTIVATION_ACTIVATION_SCALAR_H_
