// Pushes that lead under other skin: folds of two surfaces that know nothing of each other.
#include <gtest/gtest.h>

#include <vector>

#include "engine/src/body/penetration.h"
#include "tests/unit/engine/loose_faces.h"

namespace dcloth::testing {
namespace {

constexpr double kClearance = 0.002;

// Two large faces across y, the body below the first and above the second, `gap` apart. The second one's corners are
// far.
LooseFaces Fold(float gap) {
  return LooseFaces({-0.1f, 0, -0.1f, 0, 0, 0.2f, 0.1f, 0, -0.1f,  // outward is up
                     -4, gap, -4, 4, gap, -4, 0, gap, 8});         // outward is down
}

// The height of a vertex over the first surface, that was in it; its nearest site is the first face's.
double Pushed(const LooseFaces& body, float height, engine::SearchBudget budget = engine::SearchBudgetOf(1)) {
  uint16_t first = 0;
  kernels::NearestJob job = body.job();
  job.nearest = job.suspect = &first;
  float position[3] = {0, height, 0};
  engine::PushOut(body.posed(), job, body.lists(), 0, kClearance, false, &budget, position);
  EXPECT_NEAR(position[0], 0, 1e-9);
  EXPECT_NEAR(position[2], 0, 1e-9);
  return static_cast<double>(position[1]);
}

TEST(PushOutTest, OneSurfaceIsLeftByTheClearance) {
  for (const float height : {-0.001f, -0.014f, -0.05f, 0.001f})
    EXPECT_NEAR(Pushed(Fold(0.2f), height), kClearance, 1e-8);
  EXPECT_EQ(Pushed(Fold(0.2f), 0.00199f), static_cast<double>(0.00199f)) << "what lies outside stays";
}

// From 14 mm below, the way out of the first surface leads under the second, which walks from the first do not see.
TEST(PushOutTest, InANarrowFoldAVertexComesToLieBetween) {
  for (const double gap : {0.0005, 0.001, 0.002, 0.003}) {
    const double height = Pushed(Fold(static_cast<float>(gap)), -0.014f);
    EXPECT_GT(height, -1e-6) << gap;
    EXPECT_LT(height, gap + 1e-6) << gap;
  }
}

// What a frame spends on such searches is bounded: then the first surface alone counts.
TEST(PushOutTest, SearchesOfTheWholeBodyRunOut) {
  EXPECT_NEAR(Pushed(Fold(0.001f), -0.014f, {100, 0}), kClearance, 1e-8);
  EXPECT_LT(Pushed(Fold(0.001f), -0.014f, {100, 3}), 0.001 + 1e-6);
}

// One search of three faces pushes the vertex, a second one of three finds it outside.
TEST(PushOutTest, TheFramesFacesRunOut) {
  const LooseFaces body = Fold(0.2f);
  uint16_t first = 0;
  kernels::NearestJob job = body.job();
  job.nearest = job.suspect = &first;
  const auto pushed = [&](uint32_t faces, uint32_t left) {
    engine::SearchBudget budget = {faces, 0};
    float position[3] = {0, -0.014f, 0};
    engine::PushOut(body.posed(), job, body.lists(), 0, kClearance, false, &budget, position);
    EXPECT_EQ(budget.faces, left) << faces;
    return static_cast<double>(position[1]);
  };
  EXPECT_EQ(pushed(0, 0), static_cast<double>(-0.014f)) << "a vertex that comes after stays where it is";
  for (const uint32_t faces : {1u, 3u, 5u, 6u}) EXPECT_NEAR(pushed(faces, 0), kClearance, 1e-8) << faces;
  EXPECT_NEAR(pushed(7, 1), kClearance, 1e-8);
  EXPECT_NEAR(pushed(100, 94), kClearance, 1e-8);
}

TEST(PushOutTest, ABudgetGrowsWithTheGarment) {
  EXPECT_EQ(engine::SearchBudgetOf(3).faces, 65536u);
  EXPECT_EQ(engine::SearchBudgetOf(2048).faces, 65536u);
  EXPECT_EQ(engine::SearchBudgetOf(2049).faces, 65568u);
  EXPECT_EQ(engine::SearchBudgetOf(65535).faces, 32u * 65535u);
  EXPECT_EQ(engine::SearchBudgetOf(65535).whole_searches, 2048u);
  EXPECT_EQ(engine::SearchBudgetOf(1024).looks, 262144u);
  EXPECT_EQ(engine::SearchBudgetOf(1025).looks, 262400u);
}

}  // namespace
}  // namespace dcloth::testing
