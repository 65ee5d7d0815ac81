#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/src/pose/affine.h"

namespace dcloth::engine {
namespace {

TEST(AngleTest, AgreesWithTheLibrary) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> turn(-3.2, 3.2), exponent(-300, 300);
  for (int i = 0; i < 200000; ++i) {
    const double angle = turn(random), scale = std::pow(10.0, exponent(random) / (1 + i % 100));
    const double y = scale * std::sin(angle), x = scale * std::cos(angle);
    ASSERT_NEAR(AngleOf(y, x), std::atan2(y, x), 1e-15) << y << ", " << x;
  }
}

TEST(AngleTest, Corners) {
  const double pi = std::acos(-1.0);
  EXPECT_EQ(AngleOf(0, 0), 0);
  EXPECT_EQ(AngleOf(0, 1), 0);
  EXPECT_EQ(AngleOf(0, -1), pi);
  EXPECT_EQ(AngleOf(1, 0), pi / 2);
  EXPECT_EQ(AngleOf(-1, 0), -pi / 2);
  EXPECT_EQ(AngleOf(1, 1), pi / 4);
  EXPECT_EQ(AngleOf(-1, -1), -(pi - pi / 4));
  EXPECT_EQ(AngleOf(5e-324, 1), 5e-324);  // the smallest turn is not lost
  EXPECT_NEAR(AngleOf(std::sqrt(2.0) - 1, 1), pi / 8, 1e-15);
}

}  // namespace
}  // namespace dcloth::engine
