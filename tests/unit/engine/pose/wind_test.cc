// Wind: what the network reads of the air, and the promises of dcloth_cloth_set_wind.
#include <array>
#include <limits>

#include "engine/src/cloth.h"
#include "tests/attack/corruption.h"
#include "tests/unit/engine/state_fixture.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {
namespace {

using Vector3 = std::array<double, 3>;

class WindTest : public ::testing::Test {
 protected:
  static TestModel Build(format::RootMotion kind, bool clamps = true) {
    ModelSpec spec;
    spec.root_motion = kind;
    TestModel model = BuildModel(spec);
    const format::FeaturesT& features = *model.tables->features;
    for (uint32_t i = 0; !clamps && i < model.numbers.d; ++i) {
      *Data<float>(model.tables.get(), *features.low, i) = -1e6f;
      *Data<float>(model.tables.get(), *features.high, i) = 1e6f;
    }
    return model;
  }

  static dcloth_status SetWind(OwnedCloth* cloth, const Vector3& wind, dcloth_error* error = nullptr) {
    const float given[3] = {static_cast<float>(wind[0]), static_cast<float>(wind[1]), static_cast<float>(wind[2])};
    return dcloth_cloth_set_wind(cloth->get(), given, error);
  }

  static std::vector<float> Moved(std::vector<float> pose, const Vector3& by) {
    for (size_t j = 0; j < pose.size(); j += 16) {
      for (size_t r = 0; r < 3; ++r)
        pose[j + 4 * r + 3] = static_cast<float>(static_cast<double>(pose[j + 4 * r + 3]) + by[r]);
    }
    return pose;
  }

  // The seven numbers of the air before they were standardised.
  std::array<double, 7> Air(OwnedCloth* cloth) const {
    const float* x = reinterpret_cast<const engine::Cloth*>(cloth->get())->features;
    std::array<double, 7> air = {};
    for (size_t i = 0; i < 7; ++i) {
      const size_t at = wide_.numbers.d - 7 + i;
      air[i] = static_cast<double>(x[at]) / wide_.numbers.inverse_deviation[at] + wide_.numbers.mean[at];
    }
    return air;
  }

  std::vector<float> Pose(double seconds) const { return PoseAt(model_.numbers, seconds); }

  TestModel model_ = Build(format::RootMotion_Air), wide_ = Build(format::RootMotion_Air, false);
  OpenedModel opened_{model_}, unclamped_{wide_};
};

struct Host {
  const char* name;
  double rate;  // frames a second; 0 wobbles
  uint32_t flags;
};

// A run in still air, and the same steps on the spot against a wind: the cloth hangs alike, at any frame rate, in
// slices, through pauses and frames that hold ticks back. The wind begins with the second frame: in the
// first the hips count as standing.
TEST_F(WindTest, RunningThroughAirIsStandingInWind) {
  const Vector3 velocity = {3.0, 0.5, -4.0};  // m/s
  const Host hosts[] = {{"30 Hz", 30, 0},
                        {"60 Hz, pipelined", 60, DCLOTH_FRAME_PIPELINED},
                        {"wobbling", 0, 0},
                        {"wobbling, pipelined", 0, DCLOTH_FRAME_PIPELINED},
                        {"144 Hz", 144, 0}};
  for (const Host& host : hosts) {
    OwnedCloth running(opened_), standing(opened_), calm(opened_);
    double time = 0, worst = 0, blown = 0;
    int frame = 0;
    for (const float seconds : FrameSeconds(host.rate, 3)) {
      time += static_cast<double>(seconds);
      const std::vector<float> steps = PoseAt(model_.numbers, 0.2 * time);
      const Vector3 way = {velocity[0] * time, velocity[1] * time, velocity[2] * time};
      if (frame == 1) {
        ASSERT_EQ(SetWind(&standing, {-velocity[0], -velocity[1], -velocity[2]}), DCLOTH_OK);
      }
      const uint32_t flags = host.flags | (frame % 17 == 5 ? DCLOTH_FRAME_HOLD : 0);
      for (int pause = 0; pause <= (frame % 7 == 3 ? 1 : 0); ++pause) {
        const float length = pause == 0 ? seconds : 0.0f;
        ASSERT_EQ(running.Update(Moved(steps, way), length, kAll, flags), DCLOTH_OK);
        ASSERT_EQ(standing.Update(steps, length, kAll, flags), DCLOTH_OK);
        ASSERT_EQ(calm.Update(steps, length, kAll, flags), DCLOTH_OK);
        std::vector<float> back = running.positions();
        for (size_t i = 0; i < back.size(); ++i)
          back[i] = static_cast<float>(static_cast<double>(back[i]) - way[i % 3]);
        worst = std::max(worst, LargestDistance(back, standing.positions()));
        blown = std::max(blown, LargestDistance(calm.positions(), standing.positions()));
      }
      ++frame;
    }
    EXPECT_LT(worst, 1e-5) << host.name;
    RecordProperty(std::string("worst_um_").append(host.name), std::to_string(worst * 1e6));
    EXPECT_GT(blown, 1e-3) << host.name << ": the wind moves nothing";
  }
}

TEST_F(WindTest, TheFirstTicks) {
  OwnedCloth cloth(unclamped_);
  const std::vector<float> pose = Pose(0);  // faces +Z
  const auto near = [&](const std::array<double, 7>& expected, const char* what) {
    const std::array<double, 7> found = Air(&cloth);
    for (size_t i = 0; i < 7; ++i) EXPECT_NEAR(found[i], expected[i], 1e-4) << what << ", number " << i;
  };
  for (int round = 0; round < 2; ++round) {
    ASSERT_EQ(SetWind(&cloth, {0.5, -0.25, 1}), DCLOTH_OK);
    ASSERT_EQ(cloth.Tick(pose, kAll), DCLOTH_OK);
    near({0.5, -0.25, 1, 0, 0, 0, 0}, "the first tick: the wind alone");
    ASSERT_EQ(cloth.Tick(Moved(pose, {0, 0, 0.125}), kAll), DCLOTH_OK);
    near({0.5, -0.25, 1 - 3.75, 0, 0, 0, 0}, "the second: no acceleration yet");
    ASSERT_EQ(cloth.Tick(Moved(pose, {0, 0, 0.125}), kAll), DCLOTH_OK);
    near({0.5, -0.25, 1, 0, 0, 0, -112.5}, "the third");
    ASSERT_EQ(SetWind(&cloth, {0, 0, 0}), DCLOTH_OK);
    ASSERT_EQ(cloth.Tick(Moved(pose, {0, 0, 0.125}), kAll), DCLOTH_OK);
    near({0, 0, 0, 0, 0, 0, 0}, "at rest in calm air");
    ASSERT_EQ(dcloth_cloth_reset(cloth.get()), DCLOTH_OK);
  }
}

// The wind is the world's: a character that has turned feels it from another side.
TEST_F(WindTest, TheHeadingTurnsTheWind) {
  OwnedCloth cloth(unclamped_);
  std::vector<float> pose = Pose(0), turned = pose;
  for (size_t j = 0; j < pose.size(); j += 16) {  // by +90 degrees about +Y: x' = z, z' = -x
    for (size_t c = 0; c < 4; ++c) turned[j + c] = pose[j + 8 + c], turned[j + 8 + c] = -pose[j + c];
  }
  ASSERT_EQ(SetWind(&cloth, {0, 0, 2}), DCLOTH_OK);
  ASSERT_EQ(cloth.Tick(turned, kAll), DCLOTH_OK);
  const std::array<double, 7> air = Air(&cloth);
  EXPECT_NEAR(air[0], -2, 1e-5);
  EXPECT_NEAR(air[1], 0, 1e-5);
  EXPECT_NEAR(air[2], 0, 1e-5);
}

// Hips on a parabola have one acceleration, whatever ticks a hitch skips; a jump has none of its own.
TEST_F(WindTest, HitchesAndJumpsKeepTheAcceleration) {
  OwnedCloth cloth(unclamped_);
  const std::vector<float> pose = Pose(0);
  const double acceleration = 1.5;
  double time = 0;
  const auto at = [&](double jump) { return Moved(pose, {0, 0, 0.5 * acceleration * time * time + jump}); };
  const auto step = [&](double seconds, double jump, uint32_t flags) {
    time += seconds;
    ASSERT_EQ(cloth.Update(at(jump), static_cast<float>(seconds), kAll, flags), DCLOTH_OK);
  };
  for (int tick = 0; tick < 10; ++tick) step(kTick, 0, 0);
  constexpr double kRounding = 4 * 2.4e-7 * 900;  // of floats up to 4 m
  EXPECT_NEAR(Air(&cloth)[6], acceleration, kRounding);
  step(7 * kTick, 0, 0);
  EXPECT_NEAR(Air(&cloth)[6], acceleration, kRounding) << "a hitch";
  step(kTick, 0, 0);
  EXPECT_NEAR(Air(&cloth)[6], acceleration, kRounding) << "after a hitch";
  const double before = Air(&cloth)[2];
  step(kTick, 2, DCLOTH_FRAME_JUMPED);
  EXPECT_NEAR(Air(&cloth)[6], 0, 1e-6) << "a jump";
  EXPECT_NEAR(Air(&cloth)[2], before, 1e-6) << "a jump keeps the velocity";
  step(kTick, 2, 0);
  EXPECT_NEAR(Air(&cloth)[6], acceleration, kRounding) << "after a jump";
  EXPECT_NEAR(Air(&cloth)[2], -acceleration * (time - kTick / 2), 1e-4);
}

TEST_F(WindTest, OtherModelsIgnoreIt) {
  for (const format::RootMotion kind : {format::RootMotion_None, format::RootMotion_Hips}) {
    const OpenedModel opened(Build(kind));
    EXPECT_EQ(dcloth_model_reads_wind(opened.get()), 0u);
    OwnedCloth blown(opened), calm(opened);
    for (int frame = 0; frame < 40; ++frame) {
      ASSERT_EQ(SetWind(&blown, {5, 0, -3.0 * frame / 40}), DCLOTH_OK);
      ASSERT_EQ(blown.Update(Pose(frame / 60.0), 1 / 60.0f, kAll), DCLOTH_OK);
      ASSERT_EQ(calm.Update(Pose(frame / 60.0), 1 / 60.0f, kAll), DCLOTH_OK);
      ASSERT_EQ(blown.positions(), calm.positions());
    }
  }
  EXPECT_EQ(dcloth_model_reads_wind(opened_.get()), 1u);
  EXPECT_EQ(dcloth_model_reads_wind(nullptr), 0u);
}

TEST_F(WindTest, WhatIsRefusedChangesNothing) {
  OwnedCloth refused(opened_), twin(opened_);
  for (OwnedCloth* cloth : {&refused, &twin}) ASSERT_EQ(SetWind(cloth, {1, 2, 3}), DCLOTH_OK);
  const double infinity = std::numeric_limits<double>::infinity(), nan = std::numeric_limits<double>::quiet_NaN();
  for (const Vector3& wind :
       {Vector3{nan, 0, 0}, {0, infinity, 0}, {0, 0, -infinity}, {100.01, 0, 0}, {60, 60, 60}, {3e38, 3e38, 0}}) {
    dcloth_error error = EmptyError();
    EXPECT_EQ(SetWind(&refused, wind, &error), DCLOTH_ERROR_ARGUMENT);
    EXPECT_NE(std::string(error.text).find("allowed: finite numbers, at most 100 m/s"), std::string::npos)
        << error.text;
    EXPECT_EQ(SetWind(&refused, wind), DCLOTH_ERROR_ARGUMENT);
  }
  const float wind[3] = {1, 2, 3};
  EXPECT_EQ(dcloth_cloth_set_wind(nullptr, wind, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_set_wind(refused.get(), nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  const auto* odd = reinterpret_cast<const float*>(reinterpret_cast<const char*>(wind) + 1);
  EXPECT_EQ(dcloth_cloth_set_wind(refused.get(), odd, nullptr), DCLOTH_ERROR_ARGUMENT);
  for (int frame = 0; frame < 9; ++frame) {
    for (OwnedCloth* cloth : {&refused, &twin})
      ASSERT_EQ(cloth->Update(Pose(frame / 30.0), 1 / 30.0f, kAll), DCLOTH_OK);
    ASSERT_EQ(refused.positions(), twin.positions());
  }
  EXPECT_EQ(SetWind(&refused, {100, 0, 0}), DCLOTH_OK);
}

// Axes and unit are the host's, whichever was told first; 100 m/s are 10,000 of centimetres.
TEST_F(WindTest, IsInTheHostsSpace) {
  const dcloth_space unreal = {sizeof(dcloth_space),    DCLOTH_AXIS_MINUS_Y, DCLOTH_AXIS_Z, DCLOTH_AXIS_X, 0.01f,
                               DCLOTH_JOINT_FRAMES_KEPT};
  OwnedCloth cloth(unclamped_);
  ASSERT_EQ(dcloth_cloth_set_space(cloth.get(), &unreal, nullptr), DCLOTH_OK);
  ASSERT_EQ(SetWind(&cloth, {300, 100, 50}), DCLOTH_OK);  // forward, right, up
  std::vector<float> pose = Pose(0);
  for (size_t j = 0; j < pose.size(); j += 16) {
    const std::vector<float> metres(pose.begin() + static_cast<ptrdiff_t>(j),
                                    pose.begin() + static_cast<ptrdiff_t>(j) + 16);
    for (size_t c = 0; c < 4; ++c) {
      const float scale = c == 3 ? 100.0f : 1.0f;
      pose[j + c] = scale * metres[8 + c], pose[j + 4 + c] = -scale * metres[c],
               pose[j + 8 + c] = scale * metres[4 + c];
    }
  }
  ASSERT_EQ(cloth.Tick(pose, kAll), DCLOTH_OK);
  const std::array<double, 7> air = Air(&cloth);
  EXPECT_NEAR(air[0], -1, 1e-4);
  EXPECT_NEAR(air[1], 0.5, 1e-4);
  EXPECT_NEAR(air[2], 3, 1e-4);
  EXPECT_EQ(SetWind(&cloth, {9999, 0, 0}), DCLOTH_OK);
  EXPECT_EQ(SetWind(&cloth, {10001, 0, 0}), DCLOTH_ERROR_ARGUMENT);
}

// A frozen cloth sleeps in a steady wind and wakes with another one.
TEST_F(WindTest, AnotherWindWakesAFrozenCloth) {
  OwnedCloth cloth(opened_);
  const auto frozen = [&] {
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    EXPECT_EQ(dcloth_cloth_describe(cloth.get(), &info), DCLOTH_OK);
    return info.frozen != 0;
  };
  const auto hold = [&](int frames) {
    for (int frame = 0; frame < frames && !frozen(); ++frame) {
      ASSERT_EQ(cloth.Update(Pose(0), 1 / 60.0f, kAll, DCLOTH_FRAME_FREEZE_IDLE), DCLOTH_OK);
    }
  };
  ASSERT_EQ(SetWind(&cloth, {1, 0, 0}), DCLOTH_OK);
  hold(2000);
  ASSERT_TRUE(frozen());
  for (int frame = 0; frame < 20; ++frame) {
    ASSERT_EQ(SetWind(&cloth, {1, 0, 0}), DCLOTH_OK);
    ASSERT_EQ(cloth.Update(Pose(0), 1 / 60.0f, kAll, DCLOTH_FRAME_FREEZE_IDLE), DCLOTH_OK);
    ASSERT_TRUE(frozen());
  }
  const StateBytes asleep = Save(&cloth);
  ASSERT_EQ(SetWind(&cloth, {1, 0, 0.01}), DCLOTH_OK);
  ASSERT_EQ(cloth.Update(Pose(0), 1 / 60.0f, kAll, DCLOTH_FRAME_FREEZE_IDLE), DCLOTH_OK);
  EXPECT_FALSE(frozen());
  // While it settles no frame of a wind that changes counts as still.
  for (int frame = 0; frame < 300; ++frame) {
    ASSERT_EQ(SetWind(&cloth, {1 + 1e-6 * frame, 0, 0}), DCLOTH_OK);
    ASSERT_EQ(cloth.Update(Pose(0), 1 / 60.0f, kAll, DCLOTH_FRAME_FREEZE_IDLE), DCLOTH_OK);
    ASSERT_FALSE(frozen()) << frame;
  }
  // A saved state knows what wind it sleeps in.
  ASSERT_EQ(Restore(&cloth, asleep), DCLOTH_OK);
  ASSERT_EQ(SetWind(&cloth, {1, 0, 0}), DCLOTH_OK);
  ASSERT_EQ(cloth.Update(Pose(0), 1 / 60.0f, kAll, DCLOTH_FRAME_FREEZE_IDLE), DCLOTH_OK);
  EXPECT_TRUE(frozen());
}

// In a gust, in the middle of ticks, before the acceleration is known.
TEST_F(WindTest, ASavedStateGoesOnToTheBit) {
  const auto wind = [](int frame) { return Vector3{std::sin(0.3 * frame) * 8, 0.1 * (frame % 5), -2}; };
  for (const uint32_t flags : {uint32_t{0}, uint32_t{DCLOTH_FRAME_PIPELINED}}) {
    for (int saved_at = 0; saved_at < 24; ++saved_at) {
      OwnedCloth original(opened_), restored(opened_);
      for (int frame = 0; frame < saved_at + 30; ++frame) {
        const std::vector<float> pose = Pose(frame / 70.0);
        const uint32_t all = flags | (frame % 11 == 7 ? DCLOTH_FRAME_JUMPED : 0);
        ASSERT_EQ(SetWind(&original, wind(frame)), DCLOTH_OK);
        ASSERT_EQ(original.Update(pose, 1 / 70.0f, kAll, all), DCLOTH_OK);
        if (frame == saved_at) {
          ASSERT_EQ(Restore(&restored, Save(&original)), DCLOTH_OK);
        }
        if (frame <= saved_at) continue;
        ASSERT_EQ(SetWind(&restored, wind(frame)), DCLOTH_OK);
        ASSERT_EQ(restored.Update(pose, 1 / 70.0f, kAll, all), DCLOTH_OK);
        ASSERT_EQ(restored.positions(), original.positions()) << saved_at << " " << frame;
      }
    }
  }
}

}  // namespace
}  // namespace dcloth::testing
