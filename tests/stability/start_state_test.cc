// Two garments with different pasts see the same motion: how fast the past is forgotten.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/stability/player.h"
#include "tests/stability/record.h"
#include "tests/stability/stability_case.h"
#include "tests/stability/statistics.h"

namespace dcloth::stability {
namespace {

class StartStateTest : public StabilityCase {
 protected:
  void Converge(const char* name, Player* other) {
    const size_t second = ticks_per_second(), ticks = 3 * second;
    const Clip& clip = garment().clips.front();
    const size_t floats = 3 * garment().vertex_count();
    Player fresh(garment(), precision());
    const size_t before = other->tick_ms().size();
    std::vector<double> distance_mm, change_mm;  // between the two, and of their E_d
    for (size_t frame = 0; frame < ticks; ++frame) {
      const std::span<const float> truth(&clip.truth[frame * floats], floats);
      const std::vector<float>& a = fresh.Step(clip.motion[frame]);
      const std::vector<float>& b = other->Step(clip.motion[frame]);
      distance_mm.push_back(MeanDistanceMm(a, b));
      change_mm.push_back(std::abs(MeanDistanceMm(a, truth) - MeanDistanceMm(b, truth)));
    }
    // The rate: the slope of the logarithm over the first second; below 1e-4 mm rounding takes over.
    std::vector<double> logarithms;
    for (size_t i = 0; i < second && distance_mm[i] > 1e-4; ++i) logarithms.push_back(std::log(distance_mm[i]));
    const double rate = logarithms.size() > 2 ? -FitSlope(logarithms).value : std::log(10.0);
    const std::span<const double> times(other->tick_ms().data() + before, ticks);
    const auto record = [&](const Figure& figure) { Record(garment(), precision(), name, times, figure); };
    record({"apart at the start, mean over vertices", distance_mm.front(), "mm"});
    record({"apart after 1 s, mean over vertices", distance_mm[second], "mm", Allowed::kAtMost,
            kLeftAfterASecond * distance_mm.front()});
    record({"difference of E_d after 1 s", change_mm[second], "mm"});
    record({"apart after 3 s, mean over vertices", distance_mm.back(), "mm", Allowed::kAtMost, kForgottenMm});
    record({"half of it forgotten in", std::log(2.0) / rate, "ticks"});
    record({"farthest vertex / garment size", other->worst_reach_m() / garment().size_m, "", Allowed::kAtMost,
            kLargestReach});
  }
};

TEST_P(StartStateTest, AnotherMotionBefore) {
  Player other(garment(), precision());
  for (const Pose& pose : garment().clips.back().motion) other.Tick(pose);
  Converge("two start states: rest, other clip", &other);
}

// The farthest that any past can leave the states: every one at its bound.
TEST_P(StartStateTest, SaturatedStates) {
  Player other(garment(), precision());
  uint32_t random = 1;
  other.FillState([&] { return ((random = random * 1664525u + 1013904223u) >> 31) != 0 ? 1.0f : -1.0f; });
  Converge("two start states: rest, |h| = 1", &other);
}

DCLOTH_STABILITY_SUITE(StartStateTest);

}  // namespace
}  // namespace dcloth::stability
