// The edges of time: pauses, hitches, jumps, resets, times that are none.
#include <limits>

#include "engine/src/cloth.h"
#include "tests/unit/engine/allocation_trap.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {
namespace {

using UpdateEdgesTest = UpdateTest;

TEST_F(UpdateEdgesTest, PausesKeepStill) {
  for (const uint32_t flags : {uint32_t{0}, uint32_t{DCLOTH_FRAME_PIPELINED}}) {
    OwnedCloth paused(opened_), twin(opened_);
    double time = 0;
    for (int frame = 0; frame < 61; ++frame) {
      const auto seconds = static_cast<float>(1.0 / 60);
      time += static_cast<double>(seconds);
      ASSERT_EQ(paused.Update(Pose(time), seconds, kAll, flags), DCLOTH_OK);
      ASSERT_EQ(twin.Update(Pose(time), seconds, kAll, flags), DCLOTH_OK);
      if (frame % 20 != 13) continue;
      const std::vector<float> before = paused.positions();
      for (int wait = 0; wait < 5; ++wait) {
        ASSERT_EQ(paused.Update(Pose(time), 0, kAll, flags), DCLOTH_OK);
        ASSERT_EQ(paused.positions(), before);
        ASSERT_EQ(Describe(&paused).tick_share, 0);
      }
    }
    EXPECT_EQ(paused.positions(), twin.positions());
  }
}

// Hosts of 0.1 may set the flag that is unused now: it changes no bit. An unknown flag is refused.
TEST_F(UpdateEdgesTest, TheUnusedFlagDoesNothing) {
  constexpr uint32_t kUnused = 4;
  OwnedCloth sets(opened_), twin(opened_);
  for (int frame = 0; frame < 60; ++frame) {
    const std::vector<float> pose = Pose(frame / 60.0);
    ASSERT_EQ(sets.Update(pose, 1 / 60.0f, kAll, kUnused), DCLOTH_OK);
    ASSERT_EQ(twin.Update(pose, 1 / 60.0f, kAll, 0), DCLOTH_OK);
    ASSERT_EQ(sets.positions(), twin.positions()) << frame;
  }
  EXPECT_EQ(sets.Update(Pose(1), 1 / 60.0f, kAll, 32), DCLOTH_ERROR_ARGUMENT);
}

// What a walk at one speed gives the network as root motion: four features at the end, equal tick after tick.
std::vector<float> RootFeatures(OwnedCloth* cloth, const Numbers& numbers) {
  const float* x = reinterpret_cast<const engine::Cloth*>(cloth->get())->features;
  return {x + numbers.d - 4, x + numbers.d};
}

std::vector<float> Moved(std::vector<float> pose, double x, double z) {
  for (size_t j = 0; j < pose.size(); j += 16) {
    pose[j + 3] = static_cast<float>(static_cast<double>(pose[j + 3]) + x);
    pose[j + 11] = static_cast<float>(static_cast<double>(pose[j + 11]) + z);
  }
  return pose;
}

// Features are standardised by up to 2 / (m/s) here, positions are floats below 128 m, a tick is 1/30 s.
constexpr float kFeatureRounding = static_cast<float>(2 * 30 * 128 * 0x1p-24 * 2);

void ExpectSameFeatures(const std::vector<float>& a, const std::vector<float>& b, const char* what) {
  for (size_t i = 0; i < a.size(); ++i) EXPECT_NEAR(a[i], b[i], kFeatureRounding) << what << ", feature " << i;
}

TEST_F(UpdateEdgesTest, HitchesRunTwoTicksAtTheRightSpeed) {
  OwnedCloth cloth(opened_);
  const std::vector<float> stance = Pose(0);
  double time = 0;
  const auto walk = [&](float seconds) {
    time += static_cast<double>(seconds);
    return Update(&cloth, Moved(stance, 0.3 * time, 0.1 * time), seconds);
  };
  for (int frame = 0; frame < 30; ++frame) ASSERT_EQ(walk(static_cast<float>(kTick)), DCLOTH_OK);
  const std::vector<float> steady = RootFeatures(&cloth, model_.numbers);
  for (const float hitch : {0.1f, 0.5f, 3.0f, 60.0f}) {
    ASSERT_EQ(walk(hitch), DCLOTH_OK);
    EXPECT_NEAR(Describe(&cloth).tick_share, DCLOTH_MAX_TICKS, 1e-3);
    ExpectSameFeatures(RootFeatures(&cloth, model_.numbers), steady, "last tick of a hitch");
    ASSERT_EQ(walk(static_cast<float>(kTick)), DCLOTH_OK);
    ExpectSameFeatures(RootFeatures(&cloth, model_.numbers), steady, "tick after a hitch");
  }
  // The first of the two ticks spans what was skipped: with a hitch that leaves only one blended tick to see.
  OwnedCloth once(opened_);
  ASSERT_EQ(once.Tick(stance, kAll), DCLOTH_OK);
  auto* inside = reinterpret_cast<engine::Cloth*>(once.get());
  engine::SkinPose skin = {inside->skin_joints, {}};
  std::vector<float> features[2];
  for (const uint32_t elapsed : {1u, 3u}) {
    engine::RootMotion root = inside->root;
    engine::ReadPose(*inside->model, inside->rig, OwnedCloth::Pose(Moved(stance, 0.01 * elapsed, 0.02 * elapsed)),
                     inside->pose_now);
    engine::MakeSkinPose(*inside->model, inside->pose_now, &skin);
    engine::UpdateFeatures(*inside->model, skin, {0, 0, 0}, elapsed, &root, inside->features);
    features[elapsed / 2] = RootFeatures(&once, model_.numbers);
  }
  ExpectSameFeatures(features[0], features[1], "three ticks of the same speed");
}

TEST_F(UpdateEdgesTest, AnAnnouncedJumpIsNoMotion) {
  OwnedCloth jumping(opened_), walking(opened_), unannounced(opened_);
  const std::vector<float> stance = Pose(0);
  double worst = 0;
  for (int frame = 0; frame < 40; ++frame) {
    const double time = frame / 60.0, jump = frame < 21 ? 0 : 64;  // a power of two: no rounding of its own
    const auto seconds = static_cast<float>(1.0 / 60);
    const std::vector<float> here = Moved(stance, 0.3 * time, 0.1 * time), there = Moved(here, jump, -jump);
    ASSERT_EQ(jumping.Update(there, seconds, kAll, frame == 21 ? DCLOTH_FRAME_JUMPED : 0), DCLOTH_OK);
    ASSERT_EQ(unannounced.Update(there, seconds, kAll, 0), DCLOTH_OK);
    ASSERT_EQ(walking.Update(here, seconds, kAll, 0), DCLOTH_OK);
    if (frame % 2 == 0) {
      ExpectSameFeatures(RootFeatures(&jumping, model_.numbers), RootFeatures(&walking, model_.numbers), "a jump");
    }
    std::vector<float> back = jumping.positions();
    for (size_t i = 0; i < back.size(); ++i) back[i] -= static_cast<float>(i % 3 == 1 ? 0 : i % 3 == 0 ? jump : -jump);
    worst = std::max(worst, LargestDistance(back, walking.positions()));
    if (frame == 22) {
      EXPECT_NE(RootFeatures(&unannounced, model_.numbers), RootFeatures(&walking, model_.numbers));
    }
  }
  // Coordinates near 64 m are floats 2^-17 m apart; the network answers to features off by kFeatureRounding.
  EXPECT_LT(worst, 1e-4);
}

TEST_F(UpdateEdgesTest, ResetEqualsFreshInTheMiddleOfATick) {
  OwnedCloth used(opened_), fresh(opened_);
  for (int frame = 0; frame < 21; ++frame)
    ASSERT_EQ(used.Update(Pose(5 + frame / 60.0), 1 / 60.0f, kAll, DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
  ASSERT_EQ(Describe(&used).in_work, 1u);
  ASSERT_EQ(dcloth_cloth_reset(used.get()), DCLOTH_OK);
  EXPECT_EQ(Describe(&used).in_work, 0u);
  EXPECT_EQ(Describe(&used).tick_share, 0);
  for (int frame = 0; frame < 21; ++frame) {
    for (OwnedCloth* cloth : {&used, &fresh})
      ASSERT_EQ(cloth->Update(Pose(frame / 60.0), 1 / 60.0f, kAll, DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
    ASSERT_EQ(used.positions(), fresh.positions()) << frame;
  }
}

// The first frame has its tick, whole, whatever its time and flags.
TEST_F(UpdateEdgesTest, TheFirstFrameIsComplete) {
  for (const float seconds : {0.0f, 1 / 144.0f, 100.0f}) {
    for (const uint32_t flags : {0, 1, 2, 3}) {
      OwnedCloth updated(opened_), ticked(opened_);
      ASSERT_EQ(updated.Update(Pose(0), seconds, kAll, flags), DCLOTH_OK);
      ASSERT_EQ(ticked.Tick(Pose(0), kAll), DCLOTH_OK);
      ASSERT_EQ(ticked.Skin(Pose(0), 1), DCLOTH_OK);
      EXPECT_EQ(updated.positions(), ticked.positions());
    }
  }
}

// Times, flags and stages that are none are in tests/attack and in ARefusedFrameSaysWhy.
TEST_F(UpdateEdgesTest, BadArgumentsAreRefused) {
  OwnedCloth twin(opened_);
  const std::vector<float> matrices = Pose(0);
  const dcloth_pose pose = OwnedCloth::Pose(matrices);
  dcloth_frame frame = {sizeof(frame), kAll, 0.01f, 0, nullptr};
  EXPECT_EQ(dcloth_cloth_update(nullptr, &pose, &frame, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_update(twin.get(), nullptr, &frame, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_update(twin.get(), &pose, nullptr, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  frame.struct_size = 8;
  EXPECT_EQ(dcloth_cloth_update(twin.get(), &pose, &frame, nullptr, nullptr), DCLOTH_ERROR_ARGUMENT);
  dcloth_cloth_info info = {};
  EXPECT_EQ(dcloth_cloth_describe(twin.get(), &info), DCLOTH_ERROR_ARGUMENT);
  EXPECT_EQ(dcloth_cloth_describe(nullptr, &info), DCLOTH_ERROR_ARGUMENT);
}

// Modes and stages may change from frame to frame; the result stays finite and near that of one mode.
TEST_F(UpdateEdgesTest, ModesMayChange) {
  OwnedCloth changing(opened_), direct(opened_);
  const std::vector<float> still = Pose(0);
  std::mt19937 random(2);
  double worst = 0;
  for (int frame = 0; frame < 400; ++frame) {
    const std::vector<float> pose = Pose(frame / 75.0);
    ASSERT_EQ(Update(&changing, pose, 1 / 75.0f, random() % 2), DCLOTH_OK);
    ASSERT_EQ(Update(&direct, pose, 1 / 75.0f), DCLOTH_OK);
    if (Describe(&changing).in_work == 0) {
      worst = std::max(worst, LargestDistance(Newest(&changing, still), Newest(&direct, still)));
    }
  }
  EXPECT_EQ(worst, 0) << "the same ticks in any mode";
}

// With every flag; after forty frames of each the character stands still, so that cloths freeze too.
TEST_F(UpdateEdgesTest, NothingAllocates) {
  OwnedCloth cloth(opened_);
  std::vector<std::vector<float>> poses;
  for (int frame = 0; frame <= 40; ++frame) poses.push_back(Pose(frame / 72.0));
  dcloth_status worst = DCLOTH_OK;
  size_t seen = 0, frozen = 0;
  {
    AllocationTrap trap;
    for (size_t frame = 0; frame < 3200; ++frame) {
      const float seconds = frame % 100 == 20 ? 0.3f : 1 / 72.0f;
      const uint32_t flags = static_cast<uint32_t>(frame / 100);
      worst = std::max(worst, cloth.Update(poses[std::min<size_t>(frame % 100, 40)], seconds, kAll, flags));
      frozen += Describe(&cloth).frozen;
    }
    seen = trap.count();
  }
  EXPECT_EQ(seen, 0u);
  EXPECT_EQ(worst, DCLOTH_OK);
  EXPECT_GT(frozen, 0u);
}

}  // namespace
}  // namespace dcloth::testing
