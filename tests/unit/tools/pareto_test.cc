#include "tools/pareto.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace dcloth::tools {
namespace {

using By = std::vector<std::optional<size_t>>;

TEST(ParetoTest, FrontIsWhatNothingBeats) {
  const std::vector<ParetoPoint> points = {{1, 5}, {2, 3}, {2.5, 3.5}, {4, 1}, {5, 5}};
  EXPECT_EQ(DominatedBy(points), (By{{}, {}, 1, {}, 3}));
}

TEST(ParetoTest, OfSeveralTheMostExactThenTheFastestIsNamed) {
  EXPECT_EQ(DominatedBy(std::vector<ParetoPoint>{{3, 3}, {1, 2}, {2, 1}}), (By{2, {}, {}}));
  EXPECT_EQ(DominatedBy(std::vector<ParetoPoint>{{3, 3}, {2, 1}, {1, 1}}), (By{2, 2, {}}));
}

TEST(ParetoTest, EqualPointsDoNotDominateEachOther) {
  EXPECT_EQ(DominatedBy(std::vector<ParetoPoint>{{1, 1}, {1, 1}}), (By{{}, {}}));
  EXPECT_EQ(DominatedBy(std::vector<ParetoPoint>{{1, 1}, {1, 1}, {1, 2}}), (By{{}, {}, 0}));
}

// A slower variant does not earn its place by a thousandth of a millimetre, but does by a step.
TEST(ParetoTest, ErrorsCountInSteps) {
  EXPECT_EQ(DominatedBy(std::vector<ParetoPoint>{{1, 7.151}, {2, 7.150}}), (By{{}, 0}));
  EXPECT_EQ(DominatedBy(std::vector<ParetoPoint>{{1, 7.161}, {2, 7.150}}), (By{{}, {}}));
}

TEST(ParetoTest, FewPoints) {
  EXPECT_TRUE(DominatedBy({}).empty());
  EXPECT_EQ(DominatedBy(std::vector<ParetoPoint>{{1, 1}}), By{{}});
}

// The definition, on many sets with ties: someone is on the front, no one on it is beaten, and everyone off it is
// beaten by the one that is named, which is on it.
TEST(ParetoTest, RandomSetsKeepTheDefinition) {
  std::mt19937 random(5);
  for (int round = 0; round < 300; ++round) {
    std::vector<ParetoPoint> points(1 + random() % 30);
    for (ParetoPoint& p : points) {
      p.ms = 0.25 * static_cast<double>(random() % 12);
      p.mm = 0.01 * static_cast<double>(random() % 9);
    }
    const By by = DominatedBy(points);
    const auto steps = [&](size_t i) { return std::lround(100 * points[i].mm); };
    size_t front = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      front += by[i] ? 0 : 1;
      if (by[i]) {
        const size_t j = *by[i];
        EXPECT_FALSE(by[j]);
        EXPECT_TRUE(points[j].ms <= points[i].ms && steps(j) <= steps(i));
        EXPECT_TRUE(points[j].ms < points[i].ms || steps(j) < steps(i));
        continue;
      }
      for (size_t j = 0; j < points.size(); ++j) {
        const bool beats = points[j].ms <= points[i].ms && steps(j) <= steps(i) &&
                           (points[j].ms < points[i].ms || steps(j) < steps(i));
        EXPECT_FALSE(beats) << i << " by " << j;
      }
    }
    EXPECT_GT(front, 0u);
  }
}

}  // namespace
}  // namespace dcloth::tools
