// Input without motion: a held pose, nothing at all, and recurrent states too small for normal floats.
#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "tests/stability/player.h"
#include "tests/stability/stability_case.h"
#include "tests/stability/statistics.h"

namespace dcloth::stability {
namespace {

class RestTest : public StabilityCase {};

struct Hold {
  size_t settled = 0;    // ticks until every later movement is within kJitterMm
  double jitter_mm = 0;  // largest movement of a vertex in a tick once `settle` ticks are over
};

Hold HoldPose(Player* player, const Pose& pose, size_t settle, size_t watch) {
  Hold hold;
  std::vector<float> last = player->Skin(pose);
  for (size_t tick = 1; tick <= settle + watch; ++tick) {
    const std::vector<float>& now = player->Step(pose);
    const double moved = LargestDistanceMm(now, last);
    if (!(moved <= kJitterMm)) hold.settled = tick;
    if (tick > settle) hold.jitter_mm = std::max(hold.jitter_mm, moved);
    last = now;
  }
  return hold;
}

// The character stops in the middle of each clip and keeps still: five seconds to settle, three to watch.
TEST_P(RestTest, HeldPose) {
  Player player(garment(), precision());
  const size_t second = ticks_per_second();
  Hold worst;
  for (const Clip& clip : garment().clips) {
    for (const size_t stop : {clip.motion.size() / 3, clip.motion.size() - 1}) {
      player.Reset();
      for (size_t frame = stop - std::min(stop, 2 * second); frame <= stop; ++frame) player.Tick(clip.motion[frame]);
      const Hold hold = HoldPose(&player, clip.motion[stop], 5 * second, 3 * second);
      worst.jitter_mm = std::max(worst.jitter_mm, hold.jitter_mm);
      worst.settled = std::max(worst.settled, hold.settled);
    }
  }
  const auto record = [&](const Figure& figure) {
    Record(garment(), precision(), "held still pose", player.tick_ms(), figure);
  };
  record({"jitter after 5 s, a tick", worst.jitter_mm, "mm", Allowed::kAtMost, kJitterMm});
  record({"settled below it after", static_cast<double>(worst.settled) / static_cast<double>(second), "s"});
  record({"farthest vertex / garment size", player.worst_reach_m() / garment().size_m, "", Allowed::kAtMost,
          kLargestReach});
}

// The character stops anywhere, also with joints bent half as far again. Cloth of a network that is not stable in some
// pose swings there forever, by several millimetres a tick.
TEST_P(RestTest, StopsAnywhere) {
  constexpr size_t kEvery = 25;
  Player player(garment(), precision());
  const size_t second = ticks_per_second();
  double worst_mm = 0;
  size_t poses = 0;
  for (const Clip& clip : garment().clips) {
    for (const double factor : {1.0, 1.5}) {
      for (size_t stop = kEvery; stop < clip.motion.size(); stop += kEvery, ++poses) {
        const auto pose = [&](size_t frame) { return Exaggerated(clip.motion[frame], garment().rig, factor); };
        player.Reset();
        for (size_t frame = stop - std::min(stop, second / 2); frame <= stop; ++frame) player.Tick(pose(frame));
        worst_mm = std::max(worst_mm, HoldPose(&player, pose(stop), 6 * second, second / 2).jitter_mm);
      }
    }
  }
  const auto record = [&](const Figure& figure) {
    Record(garment(), precision(), "stops anywhere", player.tick_ms(), figure);
  };
  record({"moves after 6 s, a tick", worst_mm, "mm", Allowed::kAtMost, kRestlessMm});
  record({"poses", static_cast<double>(poses), ""});
}

// Every matrix zero: the garment shrinks into the hips and stays there.
TEST_P(RestTest, ZeroInput) {
  Player player(garment(), precision());
  const Pose zero(garment().rig.bind.size(), Matrix::Zero());
  const Hold hold = HoldPose(&player, zero, 5 * ticks_per_second(), ticks_per_second());
  const auto record = [&](const Figure& figure) {
    Record(garment(), precision(), "zero input", player.tick_ms(), figure);
  };
  record({"jitter after 5 s, a tick", hold.jitter_mm, "mm", Allowed::kAtMost, kJitterMm});
  record({"farthest vertex / garment size", player.worst_reach_m() / garment().size_m, "", Allowed::kAtMost,
          kLargestReach});
  record({"largest |h|", player.LargestState(), ""});
}

// A state of 1e-41 is lost in the first sum with anything normal: a garment that starts with it goes the way
// of one that starts from zero. Its first tick must also be no trap: subnormal arithmetic is slow on many
// CPUs.
TEST_P(RestTest, SubnormalStates) {
  const Motion& motion = garment().clips.front().motion;
  Player plain(garment(), precision()), small(garment(), precision());
  double worst_mm = 0;
  std::vector<double> first_ms, plain_ms;
  for (size_t round = 0; round < 20; ++round) {
    plain.Reset();
    small.Reset();
    float sign = 1e-41f;
    small.FillState([&] { return sign = -sign; });
    for (size_t frame = round; frame < round + 2; ++frame) {
      const std::vector<float> expected = plain.Step(motion[frame]);
      worst_mm = std::max(worst_mm, LargestDistanceMm(small.Step(motion[frame]), expected));
    }
    plain_ms.push_back(plain.tick_ms()[2 * round]);
    first_ms.push_back(small.tick_ms()[2 * round]);
  }
  const auto record = [&](const Figure& figure) {
    Record(garment(), precision(), "subnormal states", first_ms, figure);
  };
  // Stored positions of a garment within 8 m of the origin have steps of 0.0005 mm: one step at most.
  record({"largest difference to zero states", worst_mm, "mm", Allowed::kAtMost, 1e3 * 0x1p-21});
  record({"farthest vertex / garment size", small.worst_reach_m() / garment().size_m, "", Allowed::kAtMost,
          kLargestReach});
  // Ticks took 12 to 18 times as long before they flushed such numbers; medians of twenty in turns differ by a few
  // percent.
  record({"tick time / that from zero states", Quantile(first_ms, 0.5) / Quantile(plain_ms, 0.5), "", Allowed::kAtMost,
          3});
}

DCLOTH_STABILITY_SUITE(RestTest);

}  // namespace
}  // namespace dcloth::stability
