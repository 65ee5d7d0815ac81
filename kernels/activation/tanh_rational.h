// tanh(x) ~ x p(x^2) / q(x^2), degree 13 over 6: with the coefficients that Eigen's ptanh publishes.
//
// Each clamp is the smallest |x| at which the quotient, rounded operation by operation, is exactly 1; beyond it the
// quotient would wander around 1 by an ulp. Rejected: degree 5 over 4 (6e-5, 0.30 against 0.43 ns an element on Zen 3):
// the error enters a recurrent state every tick.
#ifndef DCLOTH_KERNELS_ACTIVATION_TANH_RATIONAL_H_
#define DCLOTH_KERNELS_ACTIVATION_TANH_RATIONAL_H_

namespace dcloth::kernels {

constexpr float kTanhNumerator[7] = {4.89352455891786e-03f, 6.37261928875436e-04f,  1.48572235717979e-05f,
                                     5.12229709037114e-08f, -8.60467152213735e-11f, 2.00018790482477e-13f,
                                     -2.76076847742355e-16f};
constexpr float kTanhDenominator[4] = {4.89352518554385e-03f, 2.26843463243900e-03f, 1.18534705686654e-04f,
                                       1.19825839466702e-06f};
constexpr float kTanhClampWithFma = 7.99881172180175781f;
constexpr float kTanhClampWithoutFma = 7.90531110763549805f;
// Where four quotients share a division, seven roundings follow: up to here they leave the quotient at most 1.
constexpr float kTanhClampShared = 7.4865f;
// Largest absolute errors over all floats, with fused multiply-add or without.
constexpr double kTanhMaxError = 4.2e-7;
constexpr double kSigmoidMaxError = kTanhMaxError / 2 + 0x1p-25;
constexpr double kTanhSharedMaxError = 7.1e-7;
constexpr double kSigmoidSharedMaxError = kTanhSharedMaxError / 2 + 0x1p-25;

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_ACTIVATION_TANH_RATIONAL_H_
