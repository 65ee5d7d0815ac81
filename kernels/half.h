// IEEE 754 binary16, exact in both directions: subnormals, infinities and NaN included, and independent of FTZ/DAZ.
#ifndef DCLOTH_KERNELS_HALF_H_
#define DCLOTH_KERNELS_HALF_H_

#include <cstdint>
#include <cstring>

namespace dcloth::kernels {

constexpr float kMaxHalf = 65504.0f;  // floats whose magnitude is below 65520 round to it or below

inline float FloatFromBits(uint32_t bits) {
  float value;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

inline uint32_t BitsFromFloat(float value) {
  uint32_t bits;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits;
}

inline float FloatFromHalf(uint16_t half) {
  const uint32_t sign = uint32_t{half & 0x8000u} << 16;
  const uint32_t exponent = (half >> 10) & 31u;
  const uint32_t mantissa = half & 1023u;
  if (exponent == 31) return FloatFromBits(sign | 0x7F800000u | (mantissa << 13));
  if (exponent != 0) return FloatFromBits(sign | ((exponent + 112) << 23) | (mantissa << 13));
  const float magnitude = static_cast<float>(mantissa) * 0x1p-24f;  // a normal float, so DAZ does not matter
  return FloatFromBits(BitsFromFloat(magnitude) | sign);
}

// Rounds to nearest, ties to even; magnitudes from 65520 up become infinity, NaN stays NaN.
inline uint16_t HalfFromFloat(float value) {
  const uint32_t bits = BitsFromFloat(value);
  const uint32_t sign = (bits >> 16) & 0x8000u;
  const uint32_t magnitude = bits & 0x7FFFFFFFu;
  if (magnitude > 0x7F800000u) return static_cast<uint16_t>(sign | 0x7E00u);
  if (magnitude >= 0x477FF000u) return static_cast<uint16_t>(sign | 0x7C00u);
  const uint32_t exponent = magnitude >> 23;
  if (exponent < 102) return static_cast<uint16_t>(sign);  // below half the smallest subnormal, 2^-25
  // Bits that fall off: 13 for normal halves (exponent 113 and up), more as a subnormal sinks.
  const uint32_t shift = exponent >= 113 ? 13 : 126 - exponent;
  const uint32_t whole = exponent >= 113 ? magnitude - (112u << 23) : (magnitude & 0x7FFFFFu) | 0x800000u;
  const uint32_t rounded = whole + ((1u << (shift - 1)) - 1) + ((whole >> shift) & 1u);
  return static_cast<uint16_t>(sign | (rounded >> shift));
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_HALF_H_
