// What goes wrong around a garment: for half a second a host feeds it something impossible, then plays on.
// The garment stays finite and near the hips all the while, and one second later it is where it would have
// been.
#include "tests/stability/disturbance.h"

#include <gtest/gtest.h>

#include <numbers>

#include "tests/stability/record.h"
#include "tests/stability/stability_case.h"

namespace dcloth::stability {
namespace {

class DisturbanceTest : public StabilityCase {
 protected:
  void Judge(const char* name, const Host& host) { Check(name, Disturb(garment(), precision(), host)); }

  void Check(const char* name, const Outcome& outcome) {
    const auto record = [&](const Figure& figure) { Record(garment(), precision(), name, outcome.tick_ms, figure); };
    record({"farthest vertex / garment size", outcome.worst_reach_m / garment().size_m, "", Allowed::kAtMost,
            kLargestReach});
    record({"largest deviation, mean over vertices", outcome.largest_mm, "mm"});
    record(
        {"deviation left after 1 s", outcome.left_mm, "mm", Allowed::kAtMost, kLeftAfterASecond * outcome.largest_mm});
    record({"change of E_d left after 1 s", outcome.excess_mm, "mm"});
  }
};

TEST_P(DisturbanceTest, Teleport) {
  Judge("teleport 50 m and back", [](Player* player, const Motion& motion, size_t frame) {
    player->Step(Moved(motion[frame], {40, 0, 30}));
  });
}

TEST_P(DisturbanceTest, TeleportWithReset) {
  Player fresh(garment(), precision());
  double largest_mm = 0;
  bool first = true;
  const Outcome outcome = Disturb(garment(), precision(), [&](Player* player, const Motion& motion, size_t frame) {
    if (frame == kDisturbedFrom) player->Reset(), first = true;
    if (first) fresh.Reset(), first = false;
    const Pose there = Moved(motion[frame], {40, 0, 30});
    const std::vector<float> expected = fresh.Step(there);
    largest_mm = std::max(largest_mm, LargestDistanceMm(player->Step(there), expected));
    if (frame + 1 == kDisturbedUntil) player->Reset();
  });
  Check("teleport and reset, and back", outcome);
  Record(garment(), precision(), "teleport and reset, and back", outcome.tick_ms,
         {"largest difference to a new garment", largest_mm, "mm", Allowed::kAtMost, 0});
}

TEST_P(DisturbanceTest, HalfTurn) {
  Judge("turned by 180 degrees in one tick", [this](Player* player, const Motion& motion, size_t frame) {
    player->Step(Turned(motion[frame], garment().rig, std::numbers::pi));
  });
}

TEST_P(DisturbanceTest, JointsFarBeyondTraining) {
  const Reach reach = FactorBeyondTraining(garment());
  const Outcome outcome = Disturb(garment(), precision(), [&](Player* player, const Motion& motion, size_t frame) {
    player->Step(Exaggerated(motion[frame], garment().rig, reach.factor));
  });
  const char* const kCase = "joints beyond training range";
  Check(kCase, outcome);
  Record(garment(), precision(), kCase, outcome.tick_ms, {"joint angles times", reach.factor, ""});
  Record(garment(), precision(), kCase, outcome.tick_ms, {"farthest feature / its trained range", reach.ratio, ""});
  // No garment's training turns hips or thighs that far.
  Record(garment(), precision(), kCase, outcome.tick_ms,
         {"largest turn of a joint", reach.turn * 180 / std::numbers::pi, "degrees", Allowed::kAtLeast, 120});
}

TEST_P(DisturbanceTest, ScaleAndShear) {
  Eigen::Matrix3d linear;
  linear << 1.4, 0.3, 0, 0, 0.7, 0, -0.3, 0, 1.2;
  Judge("scale 0.7 to 1.4 and shear 0.3",
        [&](Player* player, const Motion& motion, size_t frame) { player->Step(Deformed(motion[frame], linear)); });
}

TEST_P(DisturbanceTest, ZeroMatrices) {
  Judge("all matrices zero",
        [](Player* player, const Motion& motion, size_t) { player->Step(Pose(motion[0].size(), Matrix::Zero())); });
}

TEST_P(DisturbanceTest, SubnormalMatrices) {
  Judge("all matrix elements 1e-40", [](Player* player, const Motion& motion, size_t) {
    player->Step(Pose(motion[0].size(), Matrix::Constant(1e-40)));
  });
}

TEST_P(DisturbanceTest, StalePose) {
  Judge("one pose repeated",
        [](Player* player, const Motion& motion, size_t) { player->Step(motion[kDisturbedFrom]); });
}

TEST_P(DisturbanceTest, DroppedTicks) {
  // Two of three ticks never happen; the garment is drawn all the same, and moves at three times the speed.
  Judge("two of three ticks dropped", [](Player* player, const Motion& motion, size_t frame) {
    if (frame % 3 == 0) player->Tick(motion[frame]);
    player->Skin(motion[frame]);
  });
}

TEST_P(DisturbanceTest, Stall) {
  Judge("no tick for half a second",
        [](Player* player, const Motion& motion, size_t frame) { player->Skin(motion[frame]); });
}

TEST_P(DisturbanceTest, ExtremeRootSpeed) {
  // 1,000 m/s out and back, 250 m away at the turn.
  const double step = 1000.0 / garment().bundle.tick_rate;
  Judge("root speed 1,000 m/s", [&](Player* player, const Motion& motion, size_t frame) {
    const size_t into = frame - kDisturbedFrom + 1, back = kDisturbedUntil - frame;
    player->Step(Moved(motion[frame], {0, 0, step * static_cast<double>(std::min(into, back))}));
  });
}

DCLOTH_STABILITY_SUITE(DisturbanceTest);

}  // namespace
}  // namespace dcloth::stability
