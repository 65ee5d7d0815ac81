// The bundled garments at any frame rate against their ticks at 30 Hz, on motion that is smooth between the bundled
// poses.
//
// A tick that falls between two frames has no pose of its own. The engine's is the parabola through three frames, so a
// joint is off by at most |t - a| |t - b| |t - c| / 6 times the motion's third derivative (the remainder of
// interpolation): with even frames of h seconds, h^3 / (9 sqrt 3) times it. Frames at 60, 90 and 120 Hz hold every
// tick; at 144 Hz h^3 is small. At 24 Hz and where frames take up to 40 ms it is not, and no other curve through the
// frames would do: one through all of them, later ones too, is off by more than a millimetre as well. The cloth is then
// off by no more than the joints.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <random>

#include "dcloth/dcloth.hpp"
#include "engine/src/time/pose_blend.h"
#include "tests/scene/smooth_motion.h"
#include "tests/stability/garment.h"

namespace dcloth::stability {
namespace {

constexpr double kTick = 1.0 / 30;
constexpr double kMillimetre = 1e-3;
// Loose cloth swings further than the joints that throw it, and remembers: a hem is off by this many times what a joint
// is, at most. Its simulation is off by ten times a change of its size.
constexpr double kSwing = 5;

class Cloth {
 public:
  explicit Cloth(const converter::OpenModel& model)
      : memory_(dcloth_cloth_storage_size(model.model())),
        positions_(3 * size_t{model.info().vertex_count}),
        stages_(model.info().stages) {
    EXPECT_EQ(dcloth_cloth_create(model.model(), memory_.data(), memory_.size(), &cloth_, nullptr), DCLOTH_OK);
  }

  void Tick(const Pose& pose) {
    const std::vector<float> matrices = Flat(pose);
    const dcloth_pose at = MakePose(matrices.data(), static_cast<uint32_t>(pose.size()));
    EXPECT_EQ(dcloth_cloth_tick(cloth_, &at, stages_, nullptr), DCLOTH_OK);
  }
  // Returns the ticks that it ran.
  int Update(const Pose& pose, float seconds) {
    const std::vector<float> matrices = Flat(pose);
    const dcloth_pose at = MakePose(matrices.data(), static_cast<uint32_t>(pose.size()));
    const dcloth_frame frame = {sizeof(frame), stages_, seconds, 0, nullptr};
    EXPECT_EQ(dcloth_cloth_update(cloth_, &at, &frame, nullptr, nullptr), DCLOTH_OK);
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    EXPECT_EQ(dcloth_cloth_describe(cloth_, &info), DCLOTH_OK);
    return static_cast<int>(std::lround(static_cast<double>(info.tick_share)));
  }
  // The newest tick, drawn on a pose.
  const std::vector<float>& On(const Pose& pose) {
    const std::vector<float> matrices = Flat(pose);
    const dcloth_pose at = MakePose(matrices.data(), static_cast<uint32_t>(pose.size()));
    const dcloth_output output = MakeOutput(positions_.data(), nullptr, static_cast<uint32_t>(positions_.size() / 3));
    EXPECT_EQ(dcloth_cloth_skin(cloth_, &at, 1, &output, nullptr), DCLOTH_OK);
    return positions_;
  }

 private:
  static std::vector<float> Flat(const Pose& pose) {
    std::vector<float> matrices;
    for (const Matrix& joint : pose) {
      for (int i = 0; i < 16; ++i) matrices.push_back(static_cast<float>(joint(i / 4, i % 4)));
    }
    return matrices;
  }

  converter::AlignedBytes memory_;
  std::vector<float> positions_;
  uint32_t stages_;
  dcloth_cloth* cloth_ = nullptr;
};

double LargestDistance(const std::vector<float>& a, const std::vector<float>& b) {
  double largest = 0;
  for (size_t i = 0; i < a.size(); i += 3) {
    double square = 0;
    for (size_t c = 0; c < 3; ++c) square += std::pow(static_cast<double>(a[i + c]) - static_cast<double>(b[i + c]), 2);
    largest = std::max(largest, std::sqrt(square));
  }
  return largest;
}

// Times of frames; at rate 0 they take between 4 and 40 ms.
std::vector<double> FrameTimes(double rate, double seconds) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uneven(0.004f, 0.04f);
  std::vector<double> times = {0};
  while (times.back() < seconds) {
    times.push_back(times.back() + static_cast<double>(rate > 0 ? static_cast<float>(1 / rate) : uneven(random)));
  }
  times.pop_back();
  return times;
}

std::vector<engine::Affine> Affines(const Pose& pose) {
  std::vector<engine::Affine> joints(pose.size());
  for (size_t j = 0; j < pose.size(); ++j) {
    for (int i = 0; i < 12; ++i) joints[j].m[i / 4][i % 4] = pose[j](i / 4, i % 4);
  }
  return joints;
}

// How far the engine's pose of a tick is off, at most over the joints, having checked each against its bound.
double JointError(const SmoothMotion& motion, const std::vector<double>& times, size_t frame, double tick) {
  const double c = times[frame], b = times[frame - 1], a = times[frame - 2];
  const std::vector<engine::Affine> older = Affines(motion.At(a)), before = Affines(motion.At(b));
  const std::vector<engine::Affine> now = Affines(motion.At(c));
  std::vector<engine::Affine> blended(now.size());
  engine::PoseBetween({older.data(), before.data(), now.data(), (b - a) / (c - b)}, (tick - b) / (c - b), now.size(),
                      blended.data());
  const Pose exact = motion.At(tick);
  double largest = 0;
  for (size_t j = 0; j < exact.size(); ++j) {
    double square = 0;
    for (int r = 0; r < 3; ++r) square += std::pow(blended[j].m[r][3] - exact[j](r, 3), 2);
    const double bound = std::abs((tick - a) * (tick - b) * (tick - c)) / 6 * motion.LargestJerk(j, a, c);
    EXPECT_LE(std::sqrt(square), bound + 1e-9) << "joint " << j << " at " << tick << " s";
    largest = std::max(largest, std::sqrt(square));
  }
  return largest;
}

struct Errors {
  double cloth = 0, joints = 0;  // at most over ticks, m
  size_t ticks = 0;
};

Errors ErrorsAt(const converter::OpenModel& model, const SmoothMotion& motion, double rate) {
  const Pose still = motion.At(0);
  Cloth updated(model), exact(model);
  Errors errors;
  const std::vector<double> times = FrameTimes(rate, motion.seconds());
  double started = 0;
  for (size_t frame = 0; frame < times.size(); ++frame) {
    const double seconds = frame == 0 ? 0 : times[frame] - times[frame - 1];
    const int due = updated.Update(motion.At(times[frame]), static_cast<float>(seconds));
    for (int i = 0; i < due; ++i, started += 1) {
      const double tick = started * kTick;
      exact.Tick(motion.At(tick));
      // A frame's time is a float; a tick within its rounding has the frame's own pose.
      if (frame > 1 && tick < times[frame] - 1e-4)
        errors.joints = std::max(errors.joints, JointError(motion, times, frame, tick));
    }
    if (due == 0) continue;
    errors.cloth = std::max(errors.cloth, LargestDistance(updated.On(still), exact.On(still)));
    ++errors.ticks;
  }
  return errors;
}

// The same ticks with poses from the smooth curve through all frames, those to come as well.
double ErrorOfAllFrames(const converter::OpenModel& model, const SmoothMotion& motion, double rate) {
  Motion frames;
  for (double seconds = 0; seconds <= motion.seconds(); seconds += 1 / rate) frames.push_back(motion.At(seconds));
  const SmoothMotion through(frames, 1 / rate);
  const Pose still = motion.At(0);
  Cloth guessed(model), exact(model);
  double largest = 0;
  for (double tick = 0; tick <= through.seconds(); tick += kTick) {
    guessed.Tick(through.At(tick));
    exact.Tick(motion.At(tick));
    largest = std::max(largest, LargestDistance(guessed.On(still), exact.On(still)));
  }
  return largest;
}

using RateParameter = std::tuple<std::string, double>;

std::string RateName(const testing::TestParamInfo<RateParameter>& info) {
  const auto rate = static_cast<int>(std::get<1>(info.param));
  return std::get<0>(info.param) + "_" + (rate > 0 ? std::to_string(rate) + "Hz" : "uneven");
}

class GarmentRateTest : public testing::TestWithParam<RateParameter> {};

TEST_P(GarmentRateTest, TicksAreThoseOfThirtyHertzAsFarAsFramesTell) {
  const auto& [name, rate] = GetParam();
  const Garment& garment = LoadGarment(name);
  const converter::OpenModel& model = garment.model(Precision::kInt8);
  for (const Clip& clip : garment.clips) {
    const Errors errors = ErrorsAt(model, SmoothMotion(clip.motion, kTick), rate);
    std::printf("%s, %g Hz: %zu ticks, cloth off by up to %.3f mm, joints by up to %.3f mm\n", clip.name.c_str(), rate,
                errors.ticks, errors.cloth * 1e3, errors.joints * 1e3);
    EXPECT_GT(errors.ticks, 100u);
    EXPECT_LE(errors.cloth, std::max(rate >= 30 ? kMillimetre : 0.0, kSwing * errors.joints))
        << clip.name << " at " << rate << " Hz";
  }
}

INSTANTIATE_TEST_SUITE_P(Bundled, GarmentRateTest,
                         testing::Combine(testing::ValuesIn(GarmentNames()),
                                          testing::Values(24.0, 30.0, 60.0, 75.0, 90.0, 120.0, 144.0, 0.0)),
                         RateName);

class SlowRateTest : public testing::TestWithParam<std::string> {};

TEST_P(SlowRateTest, AtTwentyFourHertzAMillimetreCannotBeHad) {
  const Garment& garment = LoadGarment(GetParam());
  const converter::OpenModel& model = garment.model(Precision::kInt8);
  double engine = 0, with_all = 0;
  for (const Clip& clip : garment.clips) {
    const SmoothMotion motion(clip.motion, kTick);
    engine = std::max(engine, ErrorsAt(model, motion, 24).cloth);
    with_all = std::max(with_all, ErrorOfAllFrames(model, motion, 24));
  }
  std::printf("24 Hz: %.3f mm by the engine, %.3f mm with all frames known\n", engine * 1e3, with_all * 1e3);
  EXPECT_GT(with_all, kMillimetre) << "then a millimetre at 24 Hz can be had";
  EXPECT_LE(engine, 2 * with_all);
}

INSTANTIATE_TEST_SUITE_P(Bundled, SlowRateTest, testing::ValuesIn(GarmentNames()),
                         [](const auto& garment) { return garment.param; });

}  // namespace
}  // namespace dcloth::stability
