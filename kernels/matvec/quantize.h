// The integer decisions of QuantizeI16, shared by the scalar and the vector source so that all of them agree to the
// bit.
#ifndef DCLOTH_KERNELS_MATVEC_QUANTIZE_H_
#define DCLOTH_KERNELS_MATVEC_QUANTIZE_H_

#include <cstddef>
#include <cstdint>

#include "kernels/half.h"

namespace dcloth::kernels {

// 128 * sum|q| < 2^31: no partial sum of products with int8 weights leaves int32.
constexpr int64_t kQuantizedSumLimit = (int64_t{1} << 24) - 1;
constexpr int32_t kQuantizedMax = 32767;

// Below this exponent scale and its inverse would leave the normal floats; coarser steps lose nothing that a float
// product could hold.
constexpr int kQuantizedMinExponent = -100;

// Adding and subtracting 1.5 * 2^23 rounds |v| < 2^22 to nearest even in the default rounding mode.
constexpr float kRoundMagic = 12582912.0f;
constexpr int32_t kRoundMagicBits = 0x4B400000;

inline float PowerOfTwo(int exponent) { return FloatFromBits(static_cast<uint32_t>(exponent + 127) << 23); }

// x * scale where that is finite, else 0 (infinity minus itself is NaN, and NaN equals nothing).
inline float FiniteProduct(float x, float scale) {
  const float product = x * scale;
  return product - product == 0.0f ? product : 0.0f;
}

// |v| < 2^22; any other gives some number. Unsigned, since that has no overflow.
inline int32_t RoundToInt(float v) {
  return static_cast<int32_t>(BitsFromFloat(v + kRoundMagic) - static_cast<uint32_t>(kRoundMagicBits));
}

// The smallest step with round(max / step) <= 32767 that is 1, 5/4, 6/4 or 7/4 times a power of two: at most a quarter
// coarser than max / 32767, where powers of two alone are up to twice, and yet the same from tick to tick while max
// moves little, so that coefficients which stand still stay rounded the same way. max is positive and finite.
inline float QuantizedStep(float max) {
  int exponent = static_cast<int>(BitsFromFloat(max) >> 23) - 127 - 14;  // max / 2^exponent is below 2^15
  if (exponent < kQuantizedMinExponent) exponent = kQuantizedMinExponent;
  const auto fits = [max](float step) { return RoundToInt(max * (1.0f / step)) <= kQuantizedMax; };
  const float eighth = PowerOfTwo((fits(PowerOfTwo(exponent)) ? exponent : exponent + 1) - 3);
  float step = 8.0f * eighth;
  while (step > 5.0f * eighth && fits(step - eighth)) step -= eighth;
  return step;
}

// By which power of two the step must be coarser so that sum|q| <= kQuantizedSumLimit, given the sum at the fine step.
// From |q'| <= (|q| + 1/2) / 2^k + 1/2 follows sum|q'| <= (sum|q| + rows/2) / 2^k + rows/2; k is the smallest that this
// proves.
inline int QuantizedCoarser(int64_t sum, size_t rows) {
  if (sum <= kQuantizedSumLimit) return 0;
  const int64_t half_rows = static_cast<int64_t>(rows / 2 + 1);
  int extra = 1;
  while (((sum + half_rows) >> extra) + 1 + half_rows > kQuantizedSumLimit) ++extra;
  return extra;
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_MATVEC_QUANTIZE_H_
