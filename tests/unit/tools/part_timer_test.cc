// What the engine tells a timer of its pieces, and what the profiler makes of it.
#include "tools/part_timer.h"

#include <gtest/gtest.h>

#include <chrono>
#include <numeric>
#include <thread>

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

void RunParts(PartTimer* timer, std::initializer_list<WorkPart> parts) {
  Stopwatch watch(timer->get());
  for (const WorkPart part : parts) {
    Work();
    watch.Lap(converter::StepOf(part), converter::WorkPartName(part));
  }
}

uint64_t At(const TimedParts& timed, WorkPart part) { return timed.parts[static_cast<size_t>(part)]; }

TEST(PartTimerTest, EveryPieceOfAWholeTickIsTold) {
  PartTimer timer;
  StepTimes steps{};
  for (size_t p = 0; p < converter::kWorkPartCount; ++p) RunParts(&timer, {static_cast<WorkPart>(p)});
  const TimedParts timed = timer.Take();
  for (size_t p = 0; p < converter::kWorkPartCount; ++p) {
    EXPECT_GE(timed.parts[p], 2000u) << WorkPartName(static_cast<WorkPart>(p));
    steps[static_cast<size_t>(converter::StepOf(static_cast<WorkPart>(p)))] += timed.parts[p];
  }
  EXPECT_EQ(timed.steps, steps);
}

// What lies between two calls of the engine is nobody's, and a piece that is no kernel is in its step alone.
TEST(PartTimerTest, OtherPiecesAreNoKernels) {
  PartTimer timer;
  RunParts(&timer, {WorkPart::kStatic});
  Work();
  {
    Stopwatch watch(timer.get());
    Work();
    watch.Lap(DCLOTH_STEP_PENETRATION, "penetration");
    Work();
    watch.Lap(DCLOTH_STEP_SKINNING, "skinning");
  }
  const TimedParts timed = timer.Take();
  EXPECT_GE(timed.steps[DCLOTH_STEP_PENETRATION], 2000u);
  EXPECT_EQ(At(timed, WorkPart::kSkinning), timed.steps[DCLOTH_STEP_SKINNING]);
  EXPECT_EQ(At(timed, WorkPart::kStatic), timed.steps[DCLOTH_STEP_STATIC]);
  EXPECT_EQ(std::accumulate(timed.parts.begin(), timed.parts.end(), uint64_t{0}),
            timed.steps[DCLOTH_STEP_SKINNING] + timed.steps[DCLOTH_STEP_STATIC]);
}

TEST(PartTimerTest, EachTakeStartsAnew) {
  PartTimer timer;
  RunParts(&timer, {WorkPart::kBasis});
  timer.Take();
  const TimedParts nothing = timer.Take();
  EXPECT_EQ(std::accumulate(nothing.steps.begin(), nothing.steps.end(), uint64_t{0}), 0u);
  EXPECT_EQ(nothing.parts, PartTimes{});
}

// However the engine cuts or interleaves pieces, each has its own time.
TEST(PartTimerTest, PiecesThatAlternateAreToldApart) {
  PartTimer timer;
  for (int i = 0; i < 48; ++i) RunParts(&timer, {WorkPart::kMeshLayers, WorkPart::kSkeletonHidden});
  const TimedParts timed = timer.Take();
  EXPECT_GE(At(timed, WorkPart::kSkeletonHidden), 48 * 2000u);
  EXPECT_EQ(At(timed, WorkPart::kSkeletonHidden), timed.steps[DCLOTH_STEP_SKELETON]);
  EXPECT_EQ(At(timed, WorkPart::kMeshLayers), timed.steps[DCLOTH_STEP_MESH]);
}

// A host of 0.1 knows no `piece`; whatever lies behind its timer is not called.
TEST(PartTimerTest, AnOlderTimerIsToldNothing) {
  PartTimer timer;
  timer.get()->struct_size = offsetof(dcloth_timer, piece);
  RunParts(&timer, {WorkPart::kStatic});
  const TimedParts timed = timer.Take();
  EXPECT_GE(timed.steps[DCLOTH_STEP_STATIC], 2000u);
  EXPECT_EQ(timed.parts, PartTimes{});
}

TEST(PartTimerTest, NamesLeadBackToTheirParts) {
  for (size_t p = 0; p < converter::kWorkPartCount; ++p) {
    WorkPart part{};
    ASSERT_TRUE(converter::FindWorkPart(converter::WorkPartName(static_cast<WorkPart>(p)), &part));
    EXPECT_EQ(static_cast<size_t>(part), p);
  }
  WorkPart part{};
  EXPECT_FALSE(converter::FindWorkPart("pose", &part));
}

// Both more than a clock costs and a part of the work that shows.
TEST(TimingTest, AnInterruptionIsToldFromAClock) {
  EXPECT_FALSE(IsInterrupted(1'000'000, 1'000'000));
  EXPECT_FALSE(IsInterrupted(1'000'000, 1'000'500)) << "clocks that differ";
  EXPECT_FALSE(IsInterrupted(100'000, 81'000)) << "a fifth, but within what a clock costs";
  EXPECT_FALSE(IsInterrupted(10'000'000, 9'600'000)) << "a twenty-fifth";
  EXPECT_TRUE(IsInterrupted(100'000, 79'000));
  EXPECT_TRUE(IsInterrupted(10'000'000, 9'400'000));
}

#if !defined(_WIN32)
TEST(TimingTest, AThreadThatSleepsWasInterrupted) {
  const uint64_t worked = ThreadNanoseconds(), start = NowNanoseconds();
  std::this_thread::sleep_for(std::chrono::milliseconds(5));
  const uint64_t work = ThreadNanoseconds() - worked, wall = NowNanoseconds() - start;
  EXPECT_GE(wall, 5'000'000u);
  EXPECT_LT(work, wall / 2);
  EXPECT_TRUE(IsInterrupted(wall, work));
}
#endif

}  // namespace
}  // namespace dcloth::tools
