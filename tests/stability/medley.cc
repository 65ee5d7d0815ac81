#include "tests/stability/medley.h"

#include <cmath>
#include <numbers>
#include <stdexcept>

namespace dcloth::stability {
namespace {

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

}  // namespace

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

}  // namespace dcloth::stability
