// Time alone, without a network: how many ticks, where between two frames, and which moment is drawn.
#include "engine/src/time/frame_clock.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace dcloth::engine {
namespace {

constexpr double kTickRate = 30;

// What frames saw, in ticks.
struct History {
  uint32_t ticks = 0;
  double lag = 0, lag_low = 2;     // at the end, and the least of the second half
  std::vector<double> shown;       // moment drawn, by the clock of the ticks
  std::vector<double> tick_times;  // where each tick lay, by the clock of the frames
};

// Plays frame times; all ticks run in the frame that finds them due or (pipelined) at 1.05 times the pace of
// time.
History Play(const std::vector<double>& steps, bool pipelined = false) {
  FrameClock clock;
  History history;
  double now = 0, newest = -1;  // tick index
  double work = 1;              // done of the newest tick
  for (size_t f = 0; f < steps.size(); ++f) {
    const DueTicks due = clock.Advance(steps[f]);
    const double step = f == 0 ? 0 : steps[f];
    now += step;
    history.ticks += due.count + due.skipped;
    newest += due.count + due.skipped;
    for (uint32_t i = 0; i < due.count; ++i) history.tick_times.push_back(now - (1 - due.fraction[i]) * step);
    if (due.count > 0) work = pipelined && f > 0 ? 0 : 1;
    work += 1.05 * step;
    const bool in_work = work < 1;
    const double behind = clock.Behind(in_work);
    EXPECT_GE(behind, 0);
    EXPECT_LT(behind, 2);
    history.shown.push_back(newest - (in_work ? 1 : 0) - behind);
    if (f >= steps.size() / 2) history.lag_low = std::min(history.lag_low, clock.lag());
  }
  history.lag = clock.lag();
  return history;
}

// A host that keeps a rate, its frame time rounded to a float of seconds.
std::vector<double> Steady(double rate, size_t frames) {
  return std::vector<double>(frames, static_cast<double>(static_cast<float>(1 / rate)) * kTickRate);
}

struct Rate {
  double hertz, lag, pipelined_lag;  // ticks; the latter as dcloth_frame says: about a tick less one frame more
};
const Rate kRates[] = {{30, 0, 0},       {60, 0.5, 1},     {90, 2.0 / 3, 4.0 / 3},
                       {120, 0.75, 1.5}, {24, 0.75, 0.75}, {144, 23.0 / 24, 1 + 19.0 / 24}};

TEST(FrameClockTest, RunsEveryTickAtItsTime) {
  for (const Rate& rate : kRates) {
    const auto frames = static_cast<size_t>(100 * rate.hertz);
    const History history = Play(Steady(rate.hertz, frames));
    const double seconds = static_cast<double>(frames - 1) / rate.hertz;
    EXPECT_EQ(history.ticks, static_cast<uint32_t>(std::floor(seconds * kTickRate + kTickTolerance)) + 1) << rate.hertz;
    ASSERT_EQ(history.tick_times.size(), history.ticks) << rate.hertz;
    for (size_t k = 0; k < history.tick_times.size(); ++k)
      ASSERT_NEAR(history.tick_times[k], static_cast<double>(k), 1.5 * kTickTolerance) << rate.hertz;
  }
}

// After 100 s the lag is what the pattern of frames and ticks needs, less what leaks away in between: 144 Hz
// comes round every five ticks.
TEST(FrameClockTest, LagIsTheLeastThatTheRateAllows) {
  for (const Rate& rate : kRates) {
    for (const bool pipelined : {false, true}) {
      const History history = Play(Steady(rate.hertz, static_cast<size_t>(100 * rate.hertz)), pipelined);
      const double expected = pipelined ? rate.pipelined_lag : rate.lag;
      EXPECT_LE(history.lag, expected + kTickTolerance) << rate.hertz << " " << pipelined;
      EXPECT_GE(history.lag_low, expected - 5 * kLagLeak - kTickTolerance) << rate.hertz << " " << pipelined;
    }
  }
}

// The moment drawn moves with the frames: never back, never faster than the leak, and a second after the
// start never slower than what a lag grown back after five ticks takes.
void ExpectEvenFlow(const std::vector<double>& steps, const History& history, double slack) {
  size_t settled = 0;
  double time = 0;
  for (size_t f = 1; f < steps.size(); ++f) {
    time += steps[f];
    const double moved = history.shown[f] - history.shown[f - 1];
    ASSERT_GE(moved, -1e-9) << f;
    if (time < kTickRate) continue;
    ++settled;
    ASSERT_LE(moved, steps[f] * (1 + kLagLeak) + 1e-9) << f;
    ASSERT_GE(moved, steps[f] - slack) << f;
  }
  ASSERT_GT(settled, 1000u);
}

TEST(FrameClockTest, DrawnMomentFlowsEvenly) {
  for (const Rate& rate : kRates) {
    for (const bool pipelined : {false, true}) {
      const std::vector<double> steps = Steady(rate.hertz, static_cast<size_t>(100 * rate.hertz));
      ExpectEvenFlow(steps, Play(steps, pipelined), 5 * kLagLeak + kTickTolerance);
    }
  }
}

// 59.94 Hz passes slowly through every position on the grid. The lag follows; a slip of one frame happens at
// most once per turn of about 33 s, which the tick count of that time bounds.
TEST(FrameClockTest, FollowsARateThatDriftsAgainstTheTicks) {
  const std::vector<double> steps = Steady(59.94, 12000);
  const History history = Play(steps);
  size_t uneven = 0;
  for (size_t f = 60; f < steps.size(); ++f) {
    const double moved = history.shown[f] - history.shown[f - 1];
    ASSERT_GE(moved, -1e-9) << f;
    if (moved < 0.9 * steps[f]) ++uneven;
  }
  const double turns = 12000 / 59.94 / (0.5 / (30 - 59.94 / 2)) + 1;
  EXPECT_LE(static_cast<double>(uneven), turns);
}

TEST(FrameClockTest, UnevenFramesNeverRunOutOrTurnBack) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> seconds(0.004, 0.04);
  std::vector<double> steps;
  for (int f = 0; f < 20000; ++f) steps.push_back(seconds(random) * kTickRate);
  for (const bool pipelined : {false, true}) {
    const History history = Play(steps, pipelined);
    for (size_t f = 1; f < steps.size(); ++f) ASSERT_GE(history.shown[f] - history.shown[f - 1], -1e-9) << f;
    EXPECT_LE(history.lag, pipelined ? 2 : 1);
    EXPECT_GE(history.lag_low, 0.8);
  }
}

TEST(FrameClockTest, HitchesKeepTheLatestTicksAndPausesKeepStill) {
  FrameClock clock;
  clock.Advance(123);  // the first frame, whatever its time
  DueTicks due = clock.Advance(5.25);
  EXPECT_EQ(due.count, kMaxTicks);
  EXPECT_EQ(due.skipped, 5 - kMaxTicks);
  EXPECT_DOUBLE_EQ(due.fraction[0], 4 / 5.25);
  EXPECT_DOUBLE_EQ(due.fraction[1], 5 / 5.25);
  const double behind = clock.Behind(false);
  for (int frame = 0; frame < 10; ++frame) {
    due = clock.Advance(0);
    EXPECT_EQ(due.count + due.skipped, 0u);
    EXPECT_EQ(clock.Behind(false), behind);
  }
  due = clock.Advance(0.75);
  EXPECT_EQ(due.count, 1u);
  EXPECT_EQ(due.skipped, 0u);
  EXPECT_EQ(due.fraction[0], 1);
}

TEST(FrameClockTest, AnyGapIsFinite) {
  for (const double gap : {1e-300, 1e-12, 1e6, 1e30, 1e300}) {
    FrameClock clock;
    clock.Advance(0);
    for (int frame = 0; frame < 3; ++frame) {
      const DueTicks due = clock.Advance(gap);
      EXPECT_LE(due.count, kMaxTicks);
      const double behind = clock.Behind(false);
      EXPECT_TRUE(behind >= 0 && behind < 2) << gap;
    }
  }
}

}  // namespace
}  // namespace dcloth::engine
