#include "tests/stability/statistics.h"

#include <gtest/gtest.h>

#include <cmath>

namespace dcloth::stability {
namespace {

TEST(StatisticsTest, StudentsTableIsMet) {
  // Critical values of printed tables, to their five digits: each moves P by less than 1e-4 of itself.
  const struct {
    size_t degrees;
    double t, p;
  } rows[] = {{1, 12.7062, 0.05},  {2, 4.30265, 0.05},   {10, 2.22814, 0.05},
              {20, 2.84534, 0.01}, {60, 3.46020, 0.001}, {120, 1.97993, 0.05}};
  for (const auto& row : rows) {
    EXPECT_NEAR(TwoSidedP(row.t, row.degrees), row.p, 1e-4 * row.p) << row.degrees;
    EXPECT_NEAR(TwoSidedP(-row.t, row.degrees), row.p, 1e-4 * row.p);
    EXPECT_NEAR(OneSidedP(row.t, row.degrees), row.p / 2, 1e-4 * row.p);
    EXPECT_NEAR(OneSidedP(-row.t, row.degrees), 1 - row.p / 2, 1e-4 * row.p);
  }
  // One degree of freedom is the Cauchy distribution: closed form.
  for (const double t : {0.1, 1.0, 3.0, 50.0}) {
    EXPECT_NEAR(TwoSidedP(t, 1), 1 - 2 * std::atan(t) / std::acos(-1.0), 1e-12);
  }
  EXPECT_EQ(TwoSidedP(0, 5), 1);
  EXPECT_EQ(TwoSidedP(INFINITY, 5), 0);
}

TEST(StatisticsTest, SlopesByHand) {
  // y = 1, 3, 2, 4: Sxy = 4, Sxx = 5, slope 0.8; residuals 0.3, -0.7... squares 1.8, error sqrt(1.8 / 2 / 5).
  const std::vector<double> y = {1, 3, 2, 4};
  const Slope slope = FitSlope(y);
  EXPECT_NEAR(slope.value, 0.8, 1e-15);
  EXPECT_NEAR(slope.standard_error, std::sqrt(0.18), 1e-15);
  EXPECT_NEAR(slope.t, 0.8 / std::sqrt(0.18), 1e-13);
  EXPECT_EQ(slope.degrees, 2u);
  EXPECT_EQ(FitSlope(std::vector<double>{5, 5, 5, 5}).t, 0);
}

TEST(StatisticsTest, ADriftIsSeenAndNoiseIsNot) {
  std::vector<double> noise, drift;
  for (int i = 0; i < 200; ++i) {
    noise.push_back(std::sin(12.9898 * i * i));  // quadratic phases: no trend
    drift.push_back(noise.back() + 0.01 * i);    // 2 in all, against a deviation of 0.7
  }
  const Slope flat = FitSlope(noise), rising = FitSlope(drift);
  EXPECT_GT(TwoSidedP(flat.t, flat.degrees), 0.01);
  EXPECT_LT(TwoSidedP(rising.t, rising.degrees), 1e-6);
}

TEST(StatisticsTest, Quantiles) {
  EXPECT_EQ(Quantile({4, 1, 3, 2}, 0.5), 2);
  EXPECT_EQ(Quantile({4, 1, 3, 2}, 0.99), 4);
  EXPECT_EQ(Quantile({7}, 0.01), 7);
}

}  // namespace
}  // namespace dcloth::stability
