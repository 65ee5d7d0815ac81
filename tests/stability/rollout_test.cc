// Motion without end, without a reset. Two thousand ticks with every change; twenty thousand, eleven minutes of play,
// where DCLOTH_STABILITY_TICKS says so (scripts/test_long.sh): only there are samples far enough apart to judge slopes.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tests/stability/medley.h"
#include "tests/stability/player.h"
#include "tests/stability/record.h"
#include "tests/stability/stability_case.h"
#include "tests/stability/statistics.h"

namespace dcloth::stability {
namespace {

constexpr size_t kTicks = 2000, kLongTicks = 20000;
constexpr size_t kDrawEvery = 10;      // ticks
constexpr size_t kCompareEvery = 100;  // ticks: samples a motion piece or more apart, so nearly independent
constexpr size_t kFreshTicks = 90;     // before it is compared a second garment has run three seconds from a reset
constexpr size_t kFreshSamples = 20;
constexpr uint64_t kSeed = 7;
// Of one test. With two slopes and one growth for each of three precisions and two garments the chance of any
// false alarm on a garment without drift stays below 2 %.
constexpr double kSignificance = 0.001;

// |h| <= 1: an update is a convex combination of h and a tanh. Each step rounds three operations, half an ulp
// of 1 at most; a rational tanh may pass 1 by its own error, 3e-7 (kernels/activation).
constexpr double kLargestState = 1.0 + 3e-7 + 3 * 0x1p-24;

class RolloutTest : public StabilityCase {};

// Positions against the hips, which is what all models of a garment share and drift would show in.
std::vector<float> AgainstHips(const std::vector<float>& positions, const Pose& pose, size_t hips) {
  std::vector<float> relative = positions;
  for (size_t i = 0; i < relative.size(); ++i) {
    relative[i] = static_cast<float>(static_cast<double>(relative[i]) - pose[hips](static_cast<int>(i % 3), 3));
  }
  return relative;
}

double MeanReachMm(const std::vector<float>& relative) {
  const std::vector<float> origin(relative.size(), 0.0f);
  return MeanDistanceMm(relative, origin);
}

struct Rollout {
  std::vector<std::vector<float>> samples;  // [ticks / kCompareEvery][n, 3] against the hips
  std::vector<double> reach_mm;             // mean vertex distance to the hips, one a sample
  std::vector<double> fresh_mm;             // [kFreshSamples] to a garment that started three seconds ago
  std::vector<double> tick_ms;
  double largest_state = 0;
  double worst_reach_m = 0;
};

size_t Ticks() {
  const char* ticks = std::getenv("DCLOTH_STABILITY_TICKS");
  return ticks == nullptr ? kTicks : std::strtoull(ticks, nullptr, 10);
}

Rollout RollOut(const Garment& garment, Precision precision) {
  const size_t ticks = Ticks(), fresh_every = ticks / kFreshSamples;
  Rollout rollout;
  Player player(garment, precision), fresh(garment, precision);
  Medley medley(garment, kSeed);
  for (size_t tick = 1; tick <= ticks; ++tick) {
    const Pose pose = medley.Next();
    player.Tick(pose);
    rollout.largest_state = std::max(rollout.largest_state, player.LargestSkeletonState());
    const size_t phase = (tick - 1) % fresh_every;
    if (phase == fresh_every - kFreshTicks) fresh.Reset();
    if (phase >= fresh_every - kFreshTicks) fresh.Tick(pose);
    if (tick % kDrawEvery != 0) continue;
    const std::vector<float>& positions = player.Skin(pose);
    if (tick % kCompareEvery == 0) {
      rollout.largest_state = std::max(rollout.largest_state, player.LargestState());
      rollout.samples.push_back(AgainstHips(positions, pose, garment.rig.hips));
      rollout.reach_mm.push_back(MeanReachMm(rollout.samples.back()));
    }
    if (tick % fresh_every == 0) rollout.fresh_mm.push_back(MeanDistanceMm(positions, fresh.Skin(pose)));
  }
  rollout.tick_ms = player.tick_ms();
  rollout.worst_reach_m = player.worst_reach_m();
  return rollout;
}

TEST_P(RolloutTest, EndlessMotion) {
  const size_t ticks = Ticks();
  ASSERT_TRUE(ticks == kTicks || ticks == kLongTicks) << "DCLOTH_STABILITY_TICKS: found " << ticks;
  const Allowed slopes = ticks == kLongTicks ? Allowed::kAtLeast : Allowed::kAnything;
  const std::string name = ticks == kLongTicks ? "20,000-tick rollout" : "2,000-tick rollout";
  const Rollout rollout = RollOut(garment(), precision());
  const auto record = [&](const Figure& figure) { Record(garment(), precision(), name, rollout.tick_ms, figure); };
  record({"largest |h|", rollout.largest_state, "", Allowed::kAtMost, kLargestState});
  record({"farthest vertex / garment size", rollout.worst_reach_m / garment().size_m, "", Allowed::kAtMost,
          kLargestReach});

  const Slope reach = FitSlope(rollout.reach_mm);
  const double run = static_cast<double>(rollout.reach_mm.size());
  record({"distance to hips: drift over the run", reach.value * run, "mm"});
  record({"distance to hips: its standard error", reach.standard_error * run, "mm"});
  record({"distance to hips: t of the slope", reach.t, ""});
  record({"distance to hips: p of no slope", TwoSidedP(reach.t, reach.degrees), "", slopes, kSignificance});

  // The same motion, once remembered from the start and once for three seconds: the motion itself cancels.
  const Slope fresh = FitSlope(rollout.fresh_mm);
  record({"old against fresh garment: mean", Mean(rollout.fresh_mm), "mm", Allowed::kAtMost, kForgottenMm});
  record({"old against fresh garment: t of the slope", fresh.t, ""});
  record({"old against fresh garment: p of no slope", TwoSidedP(fresh.t, fresh.degrees), "", slopes, kSignificance});

  // fp32 runs first; its samples stay for the others. Only their garment is kept.
  static std::map<std::string, std::vector<std::vector<float>>> reference;
  if (precision() == Precision::kFp32) {
    reference.clear();
    reference[garment().name] = rollout.samples;
    return;
  }
  std::vector<std::vector<float>>& expected = reference[garment().name];
  if (expected.empty()) expected = RollOut(garment(), Precision::kFp32).samples;
  std::vector<double> error_mm;
  for (size_t i = 0; i < expected.size(); ++i) {
    error_mm.push_back(MeanDistanceMm(rollout.samples[i], expected[i]));
  }
  const Slope growth = FitSlope(error_mm);
  const size_t half = error_mm.size() / 2;
  record({"to fp32: mean", Mean(error_mm), "mm"});
  record({"to fp32: mean of the first half", Mean(std::span(error_mm).first(half)), "mm"});
  record({"to fp32: mean of the second half", Mean(std::span(error_mm).last(half)), "mm"});
  record({"to fp32: t of the growth", growth.t, ""});
  record({"to fp32: p of no growth", OneSidedP(growth.t, growth.degrees), "", slopes, kSignificance});
}

DCLOTH_STABILITY_SUITE(RolloutTest);

}  // namespace
}  // namespace dcloth::stability
