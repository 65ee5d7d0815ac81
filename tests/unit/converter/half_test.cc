#include "converter/half.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <limits>

namespace dcloth::converter {
namespace {

bool IsNan(uint16_t half) { return (half & 0x7FFFu) > 0x7C00u; }

// The definition in IEEE 754-2019, 3.4, in double.
double Decode(uint16_t half) {
  const int exponent = (half >> 10) & 31, mantissa = half & 1023;
  const double sign = (half & 0x8000) != 0 ? -1 : 1;
  if (exponent == 31) return mantissa == 0 ? sign * INFINITY : NAN;
  return sign * (exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25));
}

TEST(HalfTest, EveryHalfWidensExactlyAndComesBack) {
  int nans = 0;
  for (uint32_t bits = 0; bits < 65536; ++bits) {
    const auto half = static_cast<uint16_t>(bits);
    const float wide = HalfToFloat(half);
    if (IsNan(half)) {
      EXPECT_TRUE(std::isnan(wide));
      EXPECT_TRUE(IsNan(FloatToHalf(wide)));
      ++nans;
      continue;
    }
    ASSERT_EQ(static_cast<double>(wide), Decode(half)) << bits;
    ASSERT_EQ(std::signbit(wide), (half & 0x8000) != 0) << bits;
    ASSERT_EQ(FloatToHalf(wide), half) << bits;
  }
  EXPECT_EQ(nans, 2 * 1023);
}

// Between each pair of neighbours: just below the middle, the middle, just above it.
TEST(HalfTest, RoundsToNearestEven) {
  for (uint16_t low = 0; low < 0x7C00u; ++low) {
    const auto high = static_cast<uint16_t>(low + 1);
    const double upper = high == 0x7C00u ? 65536 : Decode(high);        // what the next half would be
    const auto middle = static_cast<float>((Decode(low) + upper) / 2);  // exact: 12 bits
    const uint16_t even = (low & 1) == 0 ? low : high;
    for (const uint16_t sign : {uint16_t{0}, uint16_t{0x8000}}) {
      const float s = sign == 0 ? 1.0f : -1.0f;
      ASSERT_EQ(FloatToHalf(s * std::nextafter(middle, 0.0f)), sign | low) << low;
      ASSERT_EQ(FloatToHalf(s * middle), sign | even) << low;
      ASSERT_EQ(FloatToHalf(s * std::nextafter(middle, INFINITY)), sign | high) << low;
    }
  }
}

TEST(HalfTest, OverflowAndUnderflow) {
  EXPECT_EQ(FloatToHalf(kMaxHalf), 0x7BFF);
  EXPECT_EQ(FloatToHalf(65519.996f), 0x7BFF);
  EXPECT_EQ(FloatToHalf(65520.0f), 0x7C00);
  EXPECT_EQ(FloatToHalf(std::numeric_limits<float>::max()), 0x7C00);
  EXPECT_EQ(FloatToHalf(-INFINITY), 0xFC00);
  EXPECT_EQ(FloatToHalf(std::numeric_limits<float>::denorm_min()), 0);
  EXPECT_EQ(FloatToHalf(-0x1p-26f), 0x8000);
}

}  // namespace
}  // namespace dcloth::converter
