#include "kernels/half.h"

#include <cmath>

#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

constexpr uint32_t kHalves = 1u << 16;
constexpr uint16_t kHalfInfinity = 0x7C00;

// From the definition: (-1)^s 2^(e-15) (1 + m/1024), and 2^-14 (m/1024) where e is 0.
double HalfByDefinition(uint16_t half) {
  const int exponent = (half >> 10) & 31;
  const double fraction = (half & 1023) / 1024.0;
  const double magnitude = exponent == 0 ? std::ldexp(fraction, -14) : std::ldexp(1.0 + fraction, exponent - 15);
  return half & 0x8000 ? -magnitude : magnitude;
}

bool IsFinite(uint16_t half) { return (half & kHalfInfinity) != kHalfInfinity; }

TEST(Half, EveryHalfBecomesItsFloat) {
  for (uint32_t i = 0; i < kHalves; ++i) {
    const auto half = static_cast<uint16_t>(i);
    const float value = FloatFromHalf(half);
    if (IsFinite(half)) {
      ASSERT_EQ(static_cast<double>(value), HalfByDefinition(half)) << i;
      ASSERT_EQ(std::signbit(value), (half & 0x8000) != 0) << i;
      ASSERT_EQ(HalfFromFloat(value), half) << i;
    } else if (half & 1023) {
      ASSERT_TRUE(std::isnan(value) && std::isnan(FloatFromHalf(HalfFromFloat(value)))) << i;
    } else {
      ASSERT_TRUE(std::isinf(value)) << i;
      ASSERT_EQ(HalfFromFloat(value), half);
    }
  }
}

// Between every two neighbouring halves: just below, at and just above the midpoint.
TEST(Half, RoundsToNearestEven) {
  for (uint16_t low = 0; low < kHalfInfinity; ++low) {
    const auto high = static_cast<uint16_t>(low + 1);
    const double top = high == kHalfInfinity ? 65536.0 : HalfByDefinition(high);
    const auto middle = static_cast<float>((HalfByDefinition(low) + top) / 2);  // exact: one more bit than a half
    const uint16_t even = low % 2 == 0 ? low : high;
    ASSERT_EQ(HalfFromFloat(middle), even) << low;
    ASSERT_EQ(HalfFromFloat(std::nextafter(middle, 0.0f)), low) << low;
    ASSERT_EQ(HalfFromFloat(std::nextafter(middle, 1e9f)), high) << low;
    ASSERT_EQ(HalfFromFloat(-middle), even | 0x8000) << low;
  }
  EXPECT_EQ(HalfFromFloat(kMaxHalf), 0x7BFF);
  EXPECT_EQ(HalfFromFloat(65519.996f), 0x7BFF);
  EXPECT_EQ(HalfFromFloat(65520.0f), kHalfInfinity);
  EXPECT_EQ(HalfFromFloat(3e38f), kHalfInfinity);
  EXPECT_EQ(HalfFromFloat(-INFINITY), 0xFC00);
  EXPECT_EQ(HalfFromFloat(-0x1p-26f), 0x8000);
  EXPECT_EQ(HalfFromFloat(1e-40f), 0);
}

class HalfTest : public KernelTest {};
DCLOTH_TEST_EVERY_TABLE(HalfTest);

// One row times 1: the product's columns are the converted weights themselves.
TEST_P(HalfTest, KernelConvertsEveryFiniteHalfExactly) {
  std::vector<uint16_t> halves;
  for (uint32_t i = 0; i < kHalves; ++i) {
    if (IsFinite(static_cast<uint16_t>(i))) halves.push_back(static_cast<uint16_t>(i));
  }
  ASSERT_EQ(halves.size() % kPanelColumns, 0u);
  const GuardedBuffer<uint16_t> weights(halves, Place::kAligned64);
  const GuardedBuffer<float> one(std::vector<float>{1.0f});
  GuardedBuffer<float> y(halves.size());
  table().matvec_f16({one.data(), weights.data(), nullptr, y.data(), 1, 1, halves.size() / kPanelColumns, false});
  for (size_t i = 0; i < halves.size(); ++i) {
    ASSERT_EQ(static_cast<double>(y[i]), HalfByDefinition(halves[i])) << table().name << " " << halves[i];
  }
}

}  // namespace
}  // namespace dcloth::kernels
