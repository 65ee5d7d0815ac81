// The search of the whole body against all faces, where no face leads to another.
#include "engine/src/body/body_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/unit/engine/loose_faces.h"

namespace dcloth::testing {
namespace {

std::vector<float> AtRandom(size_t faces, std::mt19937* random) {
  std::uniform_real_distribution<float> place(-1, 1), corner(-0.4f, 0.4f);
  std::vector<float> positions;
  for (size_t f = 0; f < faces; ++f) {
    const float middle[3] = {place(*random), place(*random), place(*random)};
    for (size_t i = 0; i < 9; ++i) positions.push_back(middle[i % 3] + corner(*random));
  }
  return positions;
}

TEST(BodySearchTest, TheWholeBodyIsSearchedWhereAWalkEnds) {
  std::mt19937 random(11);
  std::uniform_real_distribution<double> place(-1.5, 1.5);
  size_t further = 0;
  for (const size_t faces : {1u, 7u, 60u, 400u}) {
    const LooseFaces body(AtRandom(faces, &random));
    for (int i = 0; i < 50; ++i) {
      const double point[3] = {place(random), place(random), place(random)};
      const auto walk = [&](uint32_t start) {
        return std::fabs(engine::SearchBody(body.posed(), start, start, point).distance);
      };
      const auto start = static_cast<uint32_t>(random() % body.vertex_count());
      double least = HUGE_VAL;
      for (uint32_t v = 0; v < body.vertex_count(); v += 3) least = std::min(least, walk(v));
      const engine::ClosestPoint found = engine::SearchWholeBody(body.posed(), body.job(), body.lists(), start, point);
      ASSERT_TRUE(found.found);
      ASSERT_NEAR(std::fabs(found.distance), least, 1e-9) << faces << " faces, point " << i;
      further += walk(start) > least + 1e-6;
    }
  }
  EXPECT_GT(further, 100u) << "walks alone would do";
}

// The only face around a corner, then that around the other two; nothing leads to another face.
TEST(BodySearchTest, FacesAreCountedAsOftenAsTheyAreLookedAt) {
  const LooseFaces body({0, 0, 0, 1, 0, 0, 0, 1, 0,    //
                         0, 0, 1, 1, 0, 1, 0, 1, 1,    //
                         5, 5, 5, 5, 5, 5, 5, 5, 5});  // no area
  const double point[3] = {0.2, 0.2, 0.1};
  const auto seen = [&](uint32_t first, uint32_t second) {
    return engine::SearchBody(body.posed(), first, second, point).faces_seen;
  };
  EXPECT_EQ(seen(0, 0), 3u);
  EXPECT_EQ(seen(0, 2), 3u) << "the second walk is spared";
  EXPECT_EQ(seen(0, 3), 6u);
  EXPECT_EQ(seen(3, 0), 6u) << "the nearer walk's and the other's";
  EXPECT_EQ(seen(6, 6), 1u) << "nothing found";
  EXPECT_EQ(seen(6, 0), 4u);
  EXPECT_EQ(engine::SearchWholeBody(body.posed(), body.job(), body.lists(), 0, point).faces_seen, 3u)
      << "the slack of the others' corners leaves them out";
}

}  // namespace
}  // namespace dcloth::testing
