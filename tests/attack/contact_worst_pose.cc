// Searches for the pose whose contact costs most: motions in which a few joints turn far beyond a human's, mutated from
// the dearest one so far.
//
//   attack_contact_worst_pose skirt.safetensors walk.safetensors --tries 400
//
// A motion starts in a frame of the sequence, turns for six ticks and rests for four; a frame counts with the least of
// three plays, in processor time of its thread. Beside it: the same of the sequence as it is.
#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <numbers>
#include <random>
#include <string>
#include <vector>

#include "bench/frame/run.h"
#include "converter/convert.h"
#include "tools/machine.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

namespace dcloth::tools {
namespace {

constexpr size_t kTurning = 6, kResting = 4, kPlays = 3;
constexpr double kFarthest = 2.6;  // radians

struct Turn {
  uint32_t joint;
  std::array<double, 3> way;  // axis times angle, radians
};

struct Motion {
  size_t start = 0;
  std::vector<Turn> turns;
  double worst_ms = 0;
  size_t worst_frame = 0;
};

using Affine = std::array<double, 12>;  // row-major [3, 4]

Affine RotationAbout(const std::array<double, 3>& way, double share, const std::array<double, 3>& centre) {
  double angle = std::hypot(way[0], way[1], way[2]), axis[3];
  for (size_t c = 0; c < 3; ++c) axis[c] = angle > 0 ? way[c] / angle : 0;
  angle *= share;
  const double s = std::sin(angle), k = 1 - std::cos(angle);
  Affine out;
  for (size_t r = 0; r < 3; ++r) {
    for (size_t c = 0; c < 3; ++c) {
      const double cross = r == c ? 0 : ((c + 3 - r) % 3 == 1 ? -1 : 1) * axis[3 - r - c];
      out[4 * r + c] = (r == c ? 1 - k : 0) + k * axis[r] * axis[c] + s * cross;
    }
    out[4 * r + 3] = centre[r];
    for (size_t c = 0; c < 3; ++c) out[4 * r + 3] -= out[4 * r + c] * centre[c];
  }
  return out;
}

class Search {
 public:
  Search(const std::string& model, const std::string& motion, uint32_t seed)
      : model_(converter::Convert(converter::ReadBundle(model), {.precision = converter::Precision::kInt8}).bytes),
        poses_(converter::ReadSequence(motion), model_.joint_names()),
        player_(model_, model_.info().stages, motion, {.flags = DCLOTH_OUTPUT_OUTSIDE_BODY}),
        random_(seed) {
    timer_.struct_size = sizeof(timer_);
    timer_.now = [](void*) {
      timespec now;
      clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
      return static_cast<uint64_t>(now.tv_sec) * 1000000000 + static_cast<uint64_t>(now.tv_nsec);
    };
  }

  // Contact of each frame but the first, ms, of the sequence as it is.
  std::vector<double> Plain() {
    return Play(poses_.frame_count(),
                [&](size_t f) { return std::vector<float>(poses_.Frame(f).begin(), poses_.Frame(f).end()); });
  }

  // Prints what the pieces of the motion's worst frame take.
  void Explain(const Motion& motion) {
    static std::vector<std::pair<std::string, double>> pieces;
    timer_.piece = [](void*, const char* name, uint64_t ns) {
      pieces.emplace_back(name, static_cast<double>(ns) * 1e-6);
    };
    player_.Reset();
    for (size_t f = 0; f <= motion.worst_frame; ++f) {
      pieces.clear();
      player_.Update(Pose(motion, std::min(1.0, static_cast<double>(f) / kTurning)), 1 / 30.0f, 0, true, &timer_);
    }
    for (const auto& [name, ms] : pieces) std::printf("  %-16s %.3f ms\n", name.c_str(), ms);
    timer_.piece = nullptr;
  }

  void Measure(Motion* motion) {
    const auto frames = Play(kTurning + kResting + 1,
                             [&](size_t f) { return Pose(*motion, std::min(1.0, static_cast<double>(f) / kTurning)); });
    const auto worst = std::max_element(frames.begin(), frames.end());
    motion->worst_ms = *worst;
    motion->worst_frame = static_cast<size_t>(worst - frames.begin()) + 1;
  }

  Motion Random() {
    Motion motion;
    motion.start = random_() % poses_.frame_count();
    for (size_t k = 1 + random_() % 3; k-- > 0;) motion.turns.push_back(RandomTurn());
    return motion;
  }

  Motion Mutate(Motion motion) {
    if (random_() % 3 == 0 && motion.turns.size() < 5) motion.turns.push_back(RandomTurn());
    if (random_() % 4 == 0) motion.start = random_() % poses_.frame_count();
    std::normal_distribution<double> near(0, 0.3);
    for (Turn& turn : motion.turns) {
      for (double& part : turn.way) part = std::clamp(part + near(random_), -kFarthest, kFarthest);
    }
    return motion;
  }

  const std::string& JointName(uint32_t joint) const { return model_.joint_names()[joint]; }

 private:
  Turn RandomTurn() {
    std::uniform_real_distribution<double> part(-kFarthest, kFarthest);
    Turn turn = {static_cast<uint32_t>(random_() % model_.info().joint_count), {}};
    for (double& each : turn.way) each = part(random_);
    return turn;
  }

  bool IsAtOrUnder(uint32_t joint, uint32_t above) const {
    for (int64_t j = joint; j >= 0; j = dcloth_model_joint_parent(model_.model(), static_cast<uint32_t>(j))) {
      if (j == above) return true;
    }
    return false;
  }

  std::vector<float> Pose(const Motion& motion, double share) const {
    std::vector<float> pose(poses_.Frame(motion.start).begin(), poses_.Frame(motion.start).end());
    for (const Turn& turn : motion.turns) {
      const float* at = &pose[size_t{16} * turn.joint];
      const Affine moved = RotationAbout(
          turn.way, share, {static_cast<double>(at[3]), static_cast<double>(at[7]), static_cast<double>(at[11])});
      for (uint32_t j = 0; j < model_.info().joint_count; ++j) {
        if (!IsAtOrUnder(j, turn.joint)) continue;
        float* m = &pose[size_t{16} * j];
        float out[12];
        for (size_t r = 0; r < 3; ++r) {
          for (size_t c = 0; c < 4; ++c) {
            double sum = c == 3 ? moved[4 * r + 3] : 0;
            for (size_t k = 0; k < 3; ++k) sum += moved[4 * r + k] * static_cast<double>(m[4 * k + c]);
            out[4 * r + c] = static_cast<float>(sum);
          }
        }
        std::memcpy(m, out, sizeof(out));
      }
    }
    return pose;
  }

  template <typename PoseOf>
  std::vector<double> Play(size_t frames, const PoseOf& pose_of) {
    std::vector<double> least;
    for (size_t play = 0; play < kPlays; ++play) {
      player_.Reset();
      for (size_t f = 0; f < frames; ++f) {
        timer_.elapsed[DCLOTH_STEP_PENETRATION] = 0;
        player_.Update(pose_of(f), 1 / 30.0f, 0, true, &timer_);
        if (f == 0) continue;
        const double ms = static_cast<double>(timer_.elapsed[DCLOTH_STEP_PENETRATION]) * 1e-6;
        if (play == 0)
          least.push_back(ms);
        else
          least[f - 1] = std::min(least[f - 1], ms);
      }
    }
    return least;
  }

  converter::OpenModel model_;
  PoseTrack poses_;
  Player player_;
  dcloth_timer timer_{};
  std::mt19937 random_;
};

}  // namespace

int Run(int argc, char** argv) {
  CLI::App app("The pose whose contact costs most, by search.");
  std::string model, motion;
  size_t tries = 400;
  double most = 1e9;
  uint32_t seed = 1;
  app.add_option("BUNDLE", model)->required();
  app.add_option("SEQ", motion)->required();
  AddIsaOption(&app);
  app.add_option("--tries", tries)->capture_default_str();
  app.add_option("--seed", seed)->capture_default_str();
  app.add_option("--most", most, "exit with 1 if the worst takes more than this many medians of the sequence");
  CLI11_PARSE(app, argc, argv);

  Search search(model, motion, seed);
  const Percentiles plain = PercentilesOf(search.Plain());
  Motion worst;
  for (size_t t = 0; t < tries; ++t) {
    Motion motion_now = t < tries / 2 ? search.Random() : search.Mutate(worst);
    search.Measure(&motion_now);
    if (motion_now.worst_ms > worst.worst_ms) worst = motion_now;
  }
  std::printf("%s, %s, contact in ms of a frame: the sequence p50 %.2f p99 %.2f max %.2f; worst of %zu motions %.2f\n",
              CpuName().c_str(), dcloth_isa_name(), plain.p50, plain.p99, plain.max, tries, worst.worst_ms);
  std::printf("from frame %zu, %zu ticks on:\n", worst.start, worst.worst_frame);
  for (const Turn& turn : worst.turns) {
    std::printf("  %-14s turns by %6.1f %6.1f %6.1f degrees about the world's axes\n",
                search.JointName(turn.joint).c_str(), turn.way[0] * 180 / std::numbers::pi,
                turn.way[1] * 180 / std::numbers::pi, turn.way[2] * 180 / std::numbers::pi);
  }
  search.Explain(worst);
  return worst.worst_ms > most * plain.p50 ? 1 : 0;
}

}  // namespace dcloth::tools
