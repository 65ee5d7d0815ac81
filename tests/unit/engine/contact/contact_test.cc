// Cloth keeps its side of a limb that goes through what the network drew.
#include <algorithm>
#include <limits>

#include "tests/unit/engine/contact/leg_in_skirt.h"

namespace dcloth::testing {
namespace {

TEST_F(LegInSkirt, HasACoreForEachBone) {
  ASSERT_EQ(*memory_.limbs.count, 3u);
  for (uint32_t k = 0; k < 3; ++k) {
    const engine::LimbCore& core = memory_.limbs.cores[k];
    EXPECT_EQ(core.joint, k + 1);
    EXPECT_EQ(core.limb, 0);
    EXPECT_NEAR(core.widest, engine::kCoreOfSkin * (k == 0 ? kThigh : kShank), 1e-5f);
  }
  EXPECT_TRUE(memory_.limbs.cores[0].bends_at_end && memory_.limbs.cores[1].bends_at_start);
  EXPECT_FALSE(memory_.limbs.cores[1].bends_at_end || memory_.limbs.cores[2].bends_at_start) << "an ankle";
}

// The skirt hangs on as if nothing had happened; the leg is lifted out through its front and comes back.
TEST_F(LegInSkirt, CoversALegThatTheTargetLetsThrough) {
  int pierced = 0, drawn_pierced = 0;
  for (int frame = 0; frame <= 30; ++frame) {
    Lift(0.8 * std::sin(3.14159 * frame / 30), 0.3);
    const std::vector<float> drawn = Draw(skirt_.positions);
    pierced += PiercedBy(skirt_.positions);
    drawn_pierced += PiercedBy(drawn);
  }
  EXPECT_GT(pierced, 10);
  EXPECT_EQ(drawn_pierced, 0);
}

TEST_F(LegInSkirt, ComesBackToTheTargetCalmly) {
  for (int frame = 0; frame <= 30; ++frame) {
    Lift(0.8 * std::sin(3.14159 * frame / 30), 0.3);
    Draw(skirt_.positions);
  }
  std::vector<float> last = Draw(skirt_.positions);
  float largest = 0;
  for (int frame = 0; frame < 45; ++frame) {
    const std::vector<float> drawn = Draw(skirt_.positions);
    for (size_t i = 0; i < drawn.size(); ++i) largest = std::max(largest, std::fabs(drawn[i] - last[i]));
    last = drawn;
  }
  EXPECT_EQ(last, skirt_.positions) << "an idle cloth is its target, to the bit";
  EXPECT_LT(largest, 0.05f);
}

TEST_F(LegInSkirt, APausedFrameIsDrawnAgainAndKeepsNothing) {
  for (int frame = 0; frame <= 10; ++frame) {
    Lift(0.1 * frame, 0.3);
    Draw(skirt_.positions);
  }
  const size_t bytes = 6 * model_.vertex_count * sizeof(int16_t);
  const std::vector<int16_t> kept(memory_.kept.places, memory_.kept.places + bytes / sizeof(int16_t));
  const std::vector<float> once = Draw(skirt_.positions, 0), again = Draw(skirt_.positions, 0);
  EXPECT_EQ(once, again);
  EXPECT_EQ(std::memcmp(kept.data(), memory_.kept.places, bytes), 0);
}

// What follows a reset hangs around the leg, however it is lifted.
TEST_F(LegInSkirt, StartsAroundALiftedLeg) {
  Lift(0.9, 0.3);
  for (int frame = 0; frame < 5; ++frame) {
    const std::vector<float> drawn = Draw(skirt_.positions);
    EXPECT_GT(PiercedBy(skirt_.positions), 0);
    EXPECT_EQ(PiercedBy(drawn), 0) << frame;
  }
}

TEST_F(LegInSkirt, MirroredSpacesInCentimetresSeeTheSame) {
  Lift(0.8, 0.3);
  std::vector<float> hosted = skirt_.positions;
  for (size_t i = 0; i < hosted.size(); ++i) hosted[i] *= i % 3 == 0 ? -100.0f : 100.0f;
  const std::vector<float> plain = Draw(skirt_.positions);
  clock_ = {};
  engine::Space unity;
  unity.sign[0] = -1;
  unity.mirrored = true;
  unity.metres_per_unit = 0.01;
  const std::vector<float> mirrored = Draw(hosted, 1.0f / 30, unity);
  for (size_t i = 0; i < plain.size(); ++i) ASSERT_NEAR(0.01f * mirrored[i], i % 3 == 0 ? -plain[i] : plain[i], 1e-4f);
}

// Joints without size or torn apart, cloth that is nowhere or no number: an end, within what a frame may list.
TEST_F(LegInSkirt, AnyPoseAndAnyClothEnd) {
  constexpr float kHuge = 1e18f, kNoNumber = std::numeric_limits<float>::quiet_NaN();
  for (const double scale : {0.0, 1e-30, 1e12}) {
    for (const float size : {0.0f, 1.0f, kHuge, kNoNumber}) {
      Lift(0.7, 0.3);
      for (const size_t j : {1, 3}) {
        for (auto& row : joints_[j].m) {
          for (double& x : row) x *= scale;
        }
      }
      std::vector<float> cloth = skirt_.positions;
      for (size_t i = 0; i < cloth.size() / 2; ++i) cloth[i] *= size;
      for (int frame = 0; frame < 3; ++frame) {
        const std::vector<float> drawn = Draw(cloth);
        ASSERT_LE(std::count(memory_.active, memory_.active + model_.vertex_count, 1), engine::kMostActive);
        if (size == 1.0f) {
          for (const float x : drawn) ASSERT_TRUE(std::isfinite(x)) << scale;
        }
      }
    }
  }
}

}  // namespace
}  // namespace dcloth::testing
