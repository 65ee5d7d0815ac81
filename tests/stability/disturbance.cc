#include "tests/stability/disturbance.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>

namespace dcloth::stability {
namespace {

// One second after the disturbance, and half a second from there.
size_t JudgedFrom(const Garment& garment) {
  return kDisturbedUntil + static_cast<size_t>(0.5 + garment.bundle.tick_rate);
}
size_t JudgedUntil(const Garment& garment) {
  return JudgedFrom(garment) + static_cast<size_t>(0.5 * garment.bundle.tick_rate);
}

// The largest distance of a rotation feature from the middle of its trained range, over half of that range.
double FarthestFeature(const Garment& garment, const Pose& pose) {
  const converter::Bundle& bundle = garment.bundle;
  const std::vector<std::string>& names = garment.joint_names();
  const Eigen::Matrix3d heading = GroundFrame(pose, garment.rig).topLeftCorner<3, 3>();
  double farthest = 0;
  Eigen::Index at = 0;
  for (const uint32_t joint : bundle.feature_joints) {
    const auto found = std::find(names.begin(), names.end(), bundle.joint_names[joint]);
    const auto j = static_cast<size_t>(found - names.begin());
    const Eigen::Matrix3d linear =
        heading.transpose() * pose[j].topLeftCorner<3, 3>() * garment.rig.bind[j].topLeftCorner<3, 3>().inverse();
    for (int i = 0; i < 9; ++i, ++at) {
      const double low = static_cast<double>(bundle.feature_low[at]),
                   high = static_cast<double>(bundle.feature_high[at]);
      const double x = (linear(i / 3, i % 3) - static_cast<double>(bundle.feature_mean[at])) /
                       static_cast<double>(bundle.feature_deviation[at]);
      // A feature that never moved in training has no range to leave.
      constexpr double kLeastRange = 1e-3;
      if (high - low > kLeastRange) farthest = std::max(farthest, std::abs(2 * x - low - high) / (high - low));
    }
  }
  return farthest;
}

// The undisturbed run of one clip.
struct Calm {
  std::vector<std::byte> memory;              // of the garment before tick kDisturbedFrom
  std::vector<std::vector<float>> positions;  // from kDisturbedUntil on
};

// Runs of all clips, and the player whose memory they can be put back into.
struct CalmRuns {
  const Garment* garment;
  Precision precision;
  std::unique_ptr<Player> player;
  std::vector<Calm> clips;
};

// Made once for all disturbances of a garment in a precision; the last one is kept.
CalmRuns& CalmRunsOf(const Garment& garment, Precision precision) {
  static CalmRuns runs = {};
  if (runs.garment == &garment && runs.precision == precision) return runs;
  runs = {&garment, precision, std::make_unique<Player>(garment, precision), {}};
  for (const Clip& clip : garment.clips) {
    Calm& calm = runs.clips.emplace_back();
    runs.player->Reset();
    for (size_t frame = 0; frame < JudgedUntil(garment); ++frame) {
      if (frame == kDisturbedFrom) calm.memory = runs.player->Save();
      const std::vector<float>& positions = runs.player->Step(clip.motion[frame]);
      if (frame >= kDisturbedUntil) calm.positions.push_back(positions);
    }
  }
  return runs;
}

}  // namespace

Outcome Disturb(const Garment& garment, Precision precision, const Host& host) {
  const CalmRuns& runs = CalmRunsOf(garment, precision);
  Player& player = *runs.player;
  const size_t from = JudgedFrom(garment), until = JudgedUntil(garment), floats = 3 * garment.vertex_count();
  const size_t calm_ticks = player.tick_ms().size();
  player.ForgetReach();
  Outcome outcome;
  for (size_t c = 0; c < garment.clips.size(); ++c) {
    const Clip& clip = garment.clips[c];
    player.Restore(runs.clips[c].memory);
    double left_mm = 0, excess_mm = 0;
    for (size_t frame = kDisturbedFrom; frame < until; ++frame) {
      if (frame < kDisturbedUntil) {
        host(&player, clip.motion, frame);
        continue;
      }
      const std::vector<float>& positions = player.Step(clip.motion[frame]);
      const std::vector<float>& calm = runs.clips[c].positions[frame - kDisturbedUntil];
      const double distance = MeanDistanceMm(positions, calm);
      outcome.largest_mm = std::max(outcome.largest_mm, distance);
      if (frame < from) continue;
      const std::span<const float> truth(&clip.truth[frame * floats], floats);
      left_mm += distance / static_cast<double>(until - from);
      excess_mm +=
          std::abs(MeanDistanceMm(positions, truth) - MeanDistanceMm(calm, truth)) / static_cast<double>(until - from);
    }
    outcome.left_mm = std::max(outcome.left_mm, left_mm);
    outcome.excess_mm = std::max(outcome.excess_mm, excess_mm);
  }
  outcome.worst_reach_m = player.worst_reach_m();
  outcome.tick_ms.assign(player.tick_ms().begin() + static_cast<std::ptrdiff_t>(calm_ticks), player.tick_ms().end());
  return outcome;
}

Reach FactorBeyondTraining(const Garment& garment) {
  Reach reach;
  for (int factor = 2; factor <= 8; ++factor) {
    Reach here = {static_cast<double>(factor)};
    for (const Clip& clip : garment.clips) {
      for (size_t frame = kDisturbedFrom; frame < kDisturbedUntil; ++frame) {
        const Pose pose = Exaggerated(clip.motion[frame], garment.rig, factor);
        here.ratio = std::max(here.ratio, FarthestFeature(garment, pose));
        here.turn = std::max(here.turn, LargestTurn(pose, garment.rig));
      }
    }
    if (here.ratio > reach.ratio) reach = here;
  }
  return reach;
}

}  // namespace dcloth::stability
