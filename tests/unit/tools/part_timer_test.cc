// The engine's stopwatch against the timer that tells its laps apart.
#include "tools/part_timer.h"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

#include "engine/src/base/stopwatch.h"

namespace dcloth::tools {
namespace {

using converter::WorkPart;
using engine::Stopwatch;

// Lets the clock move, so that no lap is empty.
void Work() {
  const uint64_t start = NowNanoseconds();
  while (NowNanoseconds() - start < 2000) {
  }
}

void RunSteps(PartTimer* timer, const std::vector<int>& steps) {
  Stopwatch watch(timer->get());
  for (const int step : steps) {
    Work();
    watch.Lap(step);
  }
}

const std::vector<int> kWholeTick = {
    DCLOTH_STEP_POSE, DCLOTH_STEP_STATIC, DCLOTH_STEP_SKELETON, DCLOTH_STEP_SKELETON,     DCLOTH_STEP_SKELETON,
    DCLOTH_STEP_MESH, DCLOTH_STEP_MESH,   DCLOTH_STEP_MESH,     DCLOTH_STEP_MESH,         DCLOTH_STEP_DISPLACEMENT,
    DCLOTH_STEP_DISPLACEMENT};

uint64_t SumOf(const TimedParts& timed, int step) {
  uint64_t sum = 0;
  for (size_t p = 0; p < timed.parts.size(); ++p) {
    if (converter::StepOf(static_cast<WorkPart>(p)) == step) sum += timed.parts[p];
  }
  return sum;
}

TEST(PartTimerTest, PiecesOfAWholeTickAreToldApart) {
  PartTimer timer(DCLOTH_STAGES_MESH);
  RunSteps(&timer, kWholeTick);
  const TimedParts timed = timer.Take();
  ASSERT_TRUE(timed.whole);
  for (size_t p = 0; p < static_cast<size_t>(WorkPart::kSkinning); ++p) {
    EXPECT_GE(timed.parts[p], 2000u) << WorkPartName(static_cast<WorkPart>(p));
  }
  for (const int step : {DCLOTH_STEP_STATIC, DCLOTH_STEP_SKELETON, DCLOTH_STEP_MESH, DCLOTH_STEP_DISPLACEMENT}) {
    EXPECT_EQ(SumOf(timed, step), timed.steps[static_cast<size_t>(step)]);
  }
  EXPECT_GT(timed.steps[DCLOTH_STEP_POSE], 0u);
}

// A call of the clock that begins something is no lap, and what lies between two calls of the engine is nobody's.
TEST(PartTimerTest, CallsFollowEachOther) {
  PartTimer timer(DCLOTH_STAGES_MESH);
  RunSteps(&timer, kWholeTick);
  Work();
  RunSteps(&timer, {DCLOTH_STEP_SKINNING, DCLOTH_STEP_PENETRATION, DCLOTH_STEP_NORMALS, DCLOTH_STEP_SKINNING});
  const TimedParts timed = timer.Take();
  ASSERT_TRUE(timed.whole);
  EXPECT_EQ(timed.parts[static_cast<size_t>(WorkPart::kSkinning)], timed.steps[DCLOTH_STEP_SKINNING]);
  EXPECT_GE(timed.steps[DCLOTH_STEP_SKINNING], 4000u);
  EXPECT_EQ(timed.parts[static_cast<size_t>(WorkPart::kNormals)], timed.steps[DCLOTH_STEP_NORMALS]);
}

TEST(PartTimerTest, EachTakeStartsAnew) {
  PartTimer timer(DCLOTH_STAGES_MESH);
  RunSteps(&timer, kWholeTick);
  timer.Take();
  const TimedParts nothing = timer.Take();
  EXPECT_FALSE(nothing.whole);
  EXPECT_EQ(std::accumulate(nothing.steps.begin(), nothing.steps.end(), uint64_t{0}), 0u);
  RunSteps(&timer, {DCLOTH_STEP_SKINNING, DCLOTH_STEP_NORMALS});
  const TimedParts drawn = timer.Take();
  EXPECT_TRUE(drawn.whole);
  EXPECT_EQ(drawn.parts[static_cast<size_t>(WorkPart::kBasis)], 0u);
  EXPECT_GE(drawn.parts[static_cast<size_t>(WorkPart::kSkinning)], 2000u);
}

TEST(PartTimerTest, ATickCutIntoPortionsIsNotToldApart) {
  PartTimer timer(DCLOTH_STAGES_MESH);
  std::vector<int> cut = kWholeTick;
  cut.push_back(DCLOTH_STEP_DISPLACEMENT);
  RunSteps(&timer, cut);
  const TimedParts timed = timer.Take();
  EXPECT_FALSE(timed.whole);
  for (const uint64_t ns : timed.parts) EXPECT_EQ(ns, 0u);
  EXPECT_GT(timed.steps[DCLOTH_STEP_DISPLACEMENT], 0u);
  RunSteps(&timer, std::vector<int>(100, DCLOTH_STEP_MESH));  // more laps than it keeps
  EXPECT_FALSE(timer.Take().whole);
}

TEST(PartTimerTest, PiecesThatRunInTurnsAreToldApart) {
  constexpr int kSkeleton = DCLOTH_STEP_SKELETON, kMesh = DCLOTH_STEP_MESH, kLast = DCLOTH_STEP_DISPLACEMENT;
  for (const size_t turns : {1, 2, 48}) {
    std::vector<int> steps = {DCLOTH_STEP_POSE, DCLOTH_STEP_STATIC, kSkeleton, kMesh};
    for (size_t i = 0; i < turns; ++i) steps.insert(steps.end(), {kMesh, kSkeleton});
    steps.insert(steps.end(), {kSkeleton, kMesh, kMesh, kMesh, kLast, kLast});
    PartTimer timer(DCLOTH_STAGES_MESH);
    RunSteps(&timer, steps);
    const TimedParts timed = timer.Take();
    ASSERT_TRUE(timed.whole) << turns;
    EXPECT_GE(timed.parts[static_cast<size_t>(WorkPart::kSkeletonHidden)], 2000 * turns);
    EXPECT_GE(timed.parts[static_cast<size_t>(WorkPart::kMeshLayers)], 2000 * (turns + 1));
    EXPECT_EQ(SumOf(timed, kSkeleton), timed.steps[kSkeleton]);
    EXPECT_EQ(SumOf(timed, kMesh), timed.steps[kMesh]);
    steps.insert(steps.end() - 3, kMesh);  // layers that were cut besides
    RunSteps(&timer, steps);
    EXPECT_FALSE(timer.Take().whole);
  }
}

TEST(PartTimerTest, FewerStagesHaveFewerPieces) {
  PartTimer skeleton(DCLOTH_STAGES_SKELETON);
  RunSteps(&skeleton, {DCLOTH_STEP_POSE, DCLOTH_STEP_STATIC, DCLOTH_STEP_SKELETON, DCLOTH_STEP_SKELETON,
                  DCLOTH_STEP_SKELETON, DCLOTH_STEP_DISPLACEMENT, DCLOTH_STEP_DISPLACEMENT});
  const TimedParts timed = skeleton.Take();
  EXPECT_TRUE(timed.whole);
  EXPECT_EQ(SumOf(timed, DCLOTH_STEP_MESH), 0u);
  EXPECT_EQ(SumOf(timed, DCLOTH_STEP_DISPLACEMENT), timed.steps[DCLOTH_STEP_DISPLACEMENT]);
  PartTimer still(DCLOTH_STAGES_STATIC);
  RunSteps(&still, {DCLOTH_STEP_POSE, DCLOTH_STEP_STATIC});
  EXPECT_TRUE(still.Take().whole);
}

}  // namespace
}  // namespace dcloth::tools
