// Motion without end, without a reset. Two thousand ticks with every change; twenty thousand, eleven minutes of play,
// where DCLOTH_STABILITY_TICKS says so (scripts/test_long.sh): only there are samples far enough apart to judge slopes.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <map>
#include <numbers>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "tests/stability/garment.h"
#include "tests/stability/player.h"
#include "tests/stability/stability_case.h"
#include "tests/stability/statistics.h"

namespace dcloth::stability {
namespace {

// Motion without end out of a few bundled clips: pieces at random places, sped up or slowed down, blended
// into each other, turned so that the character stays near the origin (far from it a world position has fewer
// bits, which would look like drift). Every transition is continuous in pose and root velocity: the garment
// is never teleported.
class Medley {
 public:
  // The same garment and seed give the same motion. Joints must be rigid (no scale); throws
  // std::invalid_argument.
  Medley(const Garment& garment, uint64_t seed);

  Pose Next();

 private:
  struct Joint {
    Eigen::Quaterniond rotation;
    Eigen::Vector3d origin;
  };
  struct Frame {
    std::vector<Joint> joints;  // relative to the ground frame
    double yaw;                 // of the ground frame, unwrapped along the clip
    Eigen::Vector3d ground;
  };
  struct Playhead {
    size_t clip = 0;
    double position = 0, speed = 1, turn = 0;  // frames, frames a tick, rad a tick
  };

  double Uniform(double low, double high);
  Playhead Draw();
  Frame Sample(const Playhead& head) const;
  double Left(const Playhead& head) const;  // ticks until the clip ends

  const Rig& rig_;
  std::vector<std::vector<Frame>> clips_;
  uint64_t random_;
  Playhead playing_, coming_;
  size_t blended_ = 0, played_ = 0, length_ = 0;  // ticks: into the blend, into the piece, of the piece
  double yaw_ = 0;
  Eigen::Vector3d ground_ = Eigen::Vector3d::Zero();
};

constexpr size_t kBlendTicks = 12;
constexpr double kShortestPiece = 40, kLongestPiece = 100;  // ticks
constexpr double kSlowest = 0.6, kFastest = 1.4;
constexpr double kTurn = 0.02;      // rad a tick at most, drawn for each piece
constexpr double kArena = 3.0;      // metres; farther out the character turns back
constexpr double kHomeTurn = 0.04;  // rad a tick, towards the origin

double Wrapped(double radians) { return std::remainder(radians, 2 * std::numbers::pi); }

double Smooth(double x) { return x * x * (3 - 2 * x); }

Eigen::Vector3d Rotated(double yaw, const Eigen::Vector3d& v) {
  return Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitY()) * v;
}

Medley::Medley(const Garment& garment, uint64_t seed) : rig_(garment.rig), random_(seed) {
  for (const Clip& clip : garment.clips) {
    std::vector<Frame>& frames = clips_.emplace_back();
    for (const Pose& pose : clip.motion) {
      const Matrix ground = GroundFrame(pose, rig_);
      Frame& frame = frames.emplace_back();
      frame.yaw = std::atan2(ground(0, 2), ground(0, 0));
      if (frames.size() > 1) {
        const double before = frames[frames.size() - 2].yaw;
        frame.yaw = before + Wrapped(frame.yaw - before);
      }
      frame.ground = ground.topRightCorner<3, 1>();
      const Matrix inverse = ground.inverse();
      for (const Matrix& joint : pose) {
        const Matrix local = inverse * joint;
        const Eigen::Matrix3d linear = local.topLeftCorner<3, 3>();
        if (!(linear.transpose() * linear).isIdentity(1e-3)) {
          throw std::invalid_argument(clip.name + ": a joint with scale or shear; a medley needs rigid joints");
        }
        frame.joints.push_back({Eigen::Quaterniond(linear), local.topRightCorner<3, 1>()});
      }
    }
  }
  playing_ = Draw();
  length_ = static_cast<size_t>(Uniform(kShortestPiece, kLongestPiece));
}

// SplitMix64 (Steele, Lea, Flood 2014): the standard library's distributions differ from one library to
// another.
double Medley::Uniform(double low, double high) {
  uint64_t z = random_ += 0x9E3779B97F4A7C15u;
  z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
  z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
  return low + (high - low) * static_cast<double>((z ^ (z >> 31)) >> 11) * 0x1p-53;
}

Medley::Playhead Medley::Draw() {
  Playhead head;
  head.clip = static_cast<size_t>(Uniform(0, static_cast<double>(clips_.size())));
  head.speed = Uniform(kSlowest, kFastest);
  head.turn = Uniform(-kTurn, kTurn);
  const double room = static_cast<double>(clips_[head.clip].size() - 1) - kShortestPiece * head.speed;
  head.position = Uniform(0, room > 0 ? room : 0);
  return head;
}

double Medley::Left(const Playhead& head) const {
  return (static_cast<double>(clips_[head.clip].size() - 1) - head.position) / head.speed;
}

Medley::Frame Medley::Sample(const Playhead& head) const {
  const std::vector<Frame>& frames = clips_[head.clip];
  const double last = static_cast<double>(frames.size() - 1);
  const double position = head.position < last ? head.position : last;
  const auto at = static_cast<size_t>(position < last ? position : last - 1);
  const double way = position - static_cast<double>(at);
  const Frame &a = frames[at], &b = frames[at + 1];
  Frame frame = {{}, a.yaw + way * (b.yaw - a.yaw), a.ground + way * (b.ground - a.ground)};
  for (size_t j = 0; j < a.joints.size(); ++j) {
    frame.joints.push_back({a.joints[j].rotation.slerp(way, b.joints[j].rotation),
                            a.joints[j].origin + way * (b.joints[j].origin - a.joints[j].origin)});
  }
  return frame;
}

Pose Medley::Next() {
  // The pose of this tick, and the root's step to the next one, both blended.
  const auto step = [&](Playhead* head, Frame* now, double* turn) {
    *now = Sample(*head);
    head->position += head->speed;
    const Frame then = Sample(*head);
    *turn = then.yaw - now->yaw + head->turn;
    return Rotated(-now->yaw, then.ground - now->ground);
  };
  Frame frame;
  double turn = 0;
  Eigen::Vector3d walk = step(&playing_, &frame, &turn);
  ++played_;
  if (blended_ == 0 && (played_ >= length_ || Left(playing_) <= static_cast<double>(kBlendTicks) + 1)) {
    coming_ = Draw();
    blended_ = 1;
  }
  if (blended_ != 0) {
    Frame next;
    double next_turn = 0;
    const Eigen::Vector3d next_walk = step(&coming_, &next, &next_turn);
    const double weight = Smooth(static_cast<double>(blended_) / static_cast<double>(kBlendTicks));
    for (size_t j = 0; j < frame.joints.size(); ++j) {
      frame.joints[j].rotation = frame.joints[j].rotation.slerp(weight, next.joints[j].rotation);
      frame.joints[j].origin += weight * (next.joints[j].origin - frame.joints[j].origin);
    }
    walk += weight * (next_walk - walk);
    turn += weight * (next_turn - turn);
    if (++blended_ > kBlendTicks) {
      playing_ = coming_;
      blended_ = played_ = 0;
      length_ = static_cast<size_t>(Uniform(kShortestPiece, kLongestPiece));
    }
  }

  Pose pose;
  const Eigen::Quaterniond heading(Eigen::AngleAxisd(yaw_, Eigen::Vector3d::UnitY()));
  for (const Joint& joint : frame.joints) {
    Matrix matrix = Matrix::Identity();
    matrix.topLeftCorner<3, 3>() = (heading * joint.rotation).toRotationMatrix();
    matrix.topRightCorner<3, 1>() = ground_ + heading * joint.origin;
    pose.push_back(matrix);
  }
  ground_ += Rotated(yaw_, walk);
  if (ground_.norm() > kArena) {
    // Which way is home: across the direction of the walk.
    const Eigen::Vector3d way = Rotated(yaw_, walk);
    turn += std::copysign(kHomeTurn, way.cross(-ground_).y());
  }
  yaw_ = Wrapped(yaw_ + turn);
  return pose;
}

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
