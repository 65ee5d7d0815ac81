// DCLOTH_FRAME_HOLD: the host chooses the frame in which a tick is paid.
#include "engine/src/cloth.h"
#include "tests/unit/engine/update_fixture.h"

namespace dcloth::testing {
namespace {

constexpr uint32_t kHold = DCLOTH_FRAME_HOLD;
constexpr float kFrame = 1 / 60.0f;

class HoldTest : public UpdateTest {};

// Held for one frame at 60 Hz, a cloth has its ticks in the other frames from then on, each with its frame's pose: the
// ticks of a cloth that started a frame later.
TEST_F(HoldTest, MovesTheGrid) {
  OwnedCloth held(opened_), plain(opened_), late(opened_);
  const std::vector<float> still = Pose(0);
  ASSERT_EQ(Update(&held, Pose(0), kFrame), DCLOTH_OK);
  ASSERT_EQ(Update(&plain, Pose(0), kFrame), DCLOTH_OK);
  for (int frame = 1; frame < 60; ++frame) {
    const std::vector<float> pose = Pose(frame / 60.0);
    ASSERT_EQ(Update(&held, pose, kFrame, frame == 2 ? kHold : 0), DCLOTH_OK);
    ASSERT_EQ(Update(&plain, pose, kFrame), DCLOTH_OK);
    EXPECT_EQ(TicksRun(&plain), frame % 2 == 0) << frame;
    EXPECT_EQ(TicksRun(&held), frame >= 3 && frame % 2 == 1) << frame;
    EXPECT_EQ(Describe(&held).tick_waits, frame == 2) << frame;
  }
}

// The tick after a hold spans the time that passed: root velocity stays the character's own, whatever was held.
TEST_F(HoldTest, KeepsTheVelocity) {
  const std::vector<float> stance = Pose(0);
  for (const int frames : {1, 2, 3, 17}) {
    OwnedCloth cloth(opened_);
    const auto* inside = reinterpret_cast<const engine::Cloth*>(cloth.get());
    float metres = 0;
    const auto walk = [&](uint32_t flags) {
      std::vector<float> pose = stance;
      for (size_t joint = 0; joint < model_.numbers.spec.joints; ++joint) pose[16 * joint + 3] += metres;
      metres += kFrame;  // 1 m/s
      return Update(&cloth, pose, kFrame, flags);
    };
    for (int frame = 0; frame < 9; ++frame) ASSERT_EQ(walk(0), DCLOTH_OK);
    for (int frame = 0; frame < frames; ++frame) {
      ASSERT_EQ(walk(kHold), DCLOTH_OK);
      ASSERT_EQ(TicksRun(&cloth), 0);
    }
    ASSERT_EQ(walk(0), DCLOTH_OK);
    double square = 0;
    for (const double v : inside->root.velocity) square += v * v;
    EXPECT_NEAR(std::sqrt(square), 1, 1e-4) << frames;
  }
}

// While ticks are held the displacement runs out at the newest one and stays there; afterwards it goes on from there.
TEST_F(HoldTest, NothingPops) {
  const std::vector<float> still = Pose(0);
  for (const double rate : {30.0, 60.0, 144.0}) {
    OwnedCloth cloth(opened_), twin(opened_);
    const auto seconds = static_cast<float>(1 / rate);
    std::vector<float> last, last_twin;
    double moved = 0, twin_moved = 0, longest = 0;
    for (int frame = 0; frame < static_cast<int>(4 * rate); ++frame) {
      const std::vector<float> pose = Pose(frame / rate);
      const bool hold = frame > static_cast<int>(rate) && frame % static_cast<int>(rate) > static_cast<int>(rate) / 2;
      ASSERT_EQ(Update(&cloth, pose, seconds, hold ? kHold : 0), DCLOTH_OK);
      ASSERT_EQ(Update(&twin, pose, seconds), DCLOTH_OK);
      const std::vector<float> drawn = DrawOn(&cloth, still, pose), drawn_twin = DrawOn(&twin, still, pose);
      if (frame > static_cast<int>(rate)) {
        moved = std::max(moved, LargestDistance(drawn, last));
        twin_moved = std::max(twin_moved, LargestDistance(drawn_twin, last_twin));
        longest = std::max(longest, LargestDistance(drawn, drawn_twin));
      }
      last = drawn;
      last_twin = drawn_twin;
    }
    std::printf("%g Hz: a frame moves up to %.3f mm, without holds %.3f mm; held for half a second up to %.3f mm off\n",
                rate, moved * 1e3, twin_moved * 1e3, longest * 1e3);
    // What half a second moved is made up for within a tick, over all the frames that it has: at 30 Hz one. The lag
    // has grown to a whole tick by then.
    EXPECT_LE(moved, longest * 30 / rate * 1.05 + twin_moved);
    EXPECT_GT(longest, twin_moved);
  }
}

// The first tick can be held too: the garment is drawn without displacement until it comes, whole and in one frame.
TEST_F(HoldTest, TheFirstTickWaits) {
  OwnedCloth held(opened_), fresh(opened_), skinned(opened_);
  for (int frame = 0; frame < 5; ++frame) {
    ASSERT_EQ(held.Update(Pose(frame / 60.0), kFrame, kAll, kHold), DCLOTH_OK);
    ASSERT_EQ(skinned.Skin(Pose(frame / 60.0), 1), DCLOTH_OK);
    ASSERT_EQ(held.positions(), skinned.positions());
    EXPECT_EQ(Describe(&held).tick_waits, 1u);
  }
  for (int frame = 5; frame < 30; ++frame) {
    for (OwnedCloth* cloth : {&held, &fresh}) ASSERT_EQ(cloth->Update(Pose(frame / 60.0), kFrame, kAll), DCLOTH_OK);
    ASSERT_EQ(held.positions(), fresh.positions()) << frame;
  }
}

// Hold says when ticks start: what is in work goes on.
TEST_F(HoldTest, ATickInWorkGoesOn) {
  OwnedCloth cloth(opened_);
  ASSERT_EQ(Update(&cloth, Pose(0), kFrame), DCLOTH_OK);
  for (int frame = 1; frame < 3; ++frame)
    ASSERT_EQ(Update(&cloth, Pose(frame / 60.0), kFrame, DCLOTH_FRAME_PIPELINED), DCLOTH_OK);
  ASSERT_EQ(Describe(&cloth).in_work, 1u);
  ASSERT_EQ(Update(&cloth, Pose(3 / 60.0), kFrame, DCLOTH_FRAME_PIPELINED | kHold), DCLOTH_OK);
  EXPECT_EQ(Describe(&cloth).in_work, 0u);
  EXPECT_GT(Describe(&cloth).tick_share, 0);
}

}  // namespace
}  // namespace dcloth::testing
