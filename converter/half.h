// IEEE 754 binary16 in software, for files: exact one way, round to nearest even the other.
#ifndef DCLOTH_CONVERTER_HALF_H_
#define DCLOTH_CONVERTER_HALF_H_

#include <cstdint>

namespace dcloth::converter {

// Largest finite half. Floats whose magnitude is below 65520 round to it or below.
constexpr float kMaxHalf = 65504.0f;

float HalfToFloat(uint16_t half);

// Round to nearest even; overflow gives infinity, NaN stays a quiet NaN.
uint16_t FloatToHalf(float value);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_HALF_H_
