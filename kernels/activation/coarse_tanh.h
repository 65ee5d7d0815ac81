// tanh(x) ~ p(x) / q(x) for arithmetic whose inputs are already rounded to 8 bits, 5 instead of 10 multiply-adds. A
// quotient kept as its two halves lets several activations share one division.
//
// p = x (p0 + p1 x^2 + p2 x^4), q = 1 + q1 x^2 + q2 x^4 + q3 x^6: the smallest largest error on |x| <= 5.8, found by
// linear programming. Beyond, x is clamped. |p / q| < 1, so that a state blended of such values stays within 1.
#ifndef DCLOTH_KERNELS_ACTIVATION_COARSE_TANH_H_
#define DCLOTH_KERNELS_ACTIVATION_COARSE_TANH_H_

namespace dcloth::kernels {

constexpr float kCoarseTanhNumerator[3] = {0.99997667f, 0.11486762f, 0.00152067f};
constexpr float kCoarseTanhDenominator[3] = {4.48125096e-01f, 1.76356727e-02f, 5.67781335e-05f};
constexpr float kCoarseTanhClamp = 5.8f;
// Largest absolute errors over all floats, the quotient's rounding included.
constexpr double kCoarseTanhMaxError = 2.4e-5;
constexpr double kCoarseSigmoidMaxError = kCoarseTanhMaxError / 2 + 0x1p-24;

namespace scalar {

struct Fraction {
  float p, q;
};

inline Fraction CoarseTanh(float x) {
  x = x < -kCoarseTanhClamp ? -kCoarseTanhClamp : x > kCoarseTanhClamp ? kCoarseTanhClamp : x;
  const float x2 = x * x;
  const float p = x2 * (x2 * kCoarseTanhNumerator[2] + kCoarseTanhNumerator[1]) + kCoarseTanhNumerator[0];
  const float q =
      x2 * (x2 * (x2 * kCoarseTanhDenominator[2] + kCoarseTanhDenominator[1]) + kCoarseTanhDenominator[0]) + 1.0f;
  return {x * p, q};
}

// (1 + tanh(x / 2)) / 2
inline Fraction CoarseSigmoid(float x) {
  const Fraction t = CoarseTanh(0.5f * x);
  return {0.5f * (t.p + t.q), t.q};
}

}  // namespace scalar
}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_ACTIVATION_COARSE_TANH_H_
