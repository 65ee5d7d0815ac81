// A shank that was drawn through the back of its skirt, far above the hem, has the hem above it.
#include "engine/src/body/hitched_cloth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/engine/body/limbs.h"

namespace dcloth::testing {
namespace {

class HitchedClothTest : public LegInSkirt {
 protected:
  static constexpr uint8_t kLeg = 1;

  HitchedClothTest() {
    engine::Arena sizes(nullptr);
    engine::PlaceHitchedCloth(model_, &sizes);
    memory_of_hems_.resize(sizes.size() + 64);
    const auto address = reinterpret_cast<uintptr_t>(memory_of_hems_.data());
    engine::Arena arena(memory_of_hems_.data() + (64 - address % 64) % 64);
    hitched_ = engine::PlaceHitchedCloth(model_, &arena);
    at_edge_.resize(kRows * kAround);
    hitched_.at_edge = at_edge_.data();
    engine::FindEdges(model_, hitched_);
  }

  static engine::Surface Of(std::vector<float>* skirt) {
    engine::Surface surface = {};
    surface.positions = skirt->data();
    surface.position_stride_bytes = 12;
    return surface;
  }

  // `laid` becomes what was `drawn`, hitched up.
  bool HitchUp(std::vector<float> drawn, std::vector<float>* laid, bool mirrored = false, uint8_t torn = kLeg) {
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::KeepDrawn(model_, hitched_, Of(&drawn));
    return engine::HitchUp(model_, mirrored, limbs_, torn, swept_, hitched_, Of(laid));
  }

  std::vector<float> HitchedUp(const std::vector<float>& drawn) {
    std::vector<float> skirt = drawn;
    EXPECT_TRUE(HitchUp(drawn, &skirt));
    return skirt;
  }

  // Of vertices from the shank and the foot.
  float Nearest(const std::vector<float>& skirt) const {
    const engine::LimbCore& shank = limbs_.cores[1];
    const float scale = (kLength + kFoot) / kLength;
    const float along[3] = {scale * shank.along[0], scale * shank.along[1], scale * shank.along[2]};
    float nearest = 1;
    for (size_t i = 0; i < skirt.size(); i += 3) {
      const float squared = engine::Dot(along, along);
      nearest = std::fmin(nearest, engine::PlaceOnBone(shank.posed_from, along, 1 / squared, &skirt[i]).squared);
    }
    return std::sqrt(nearest);
  }

  std::vector<uint8_t> memory_of_hems_, at_edge_;
  engine::HitchedCloth hitched_ = {};
};

TEST_F(HitchedClothTest, EdgesAreTheWaistAndTheHem) {
  for (size_t v = 0; v < kRows * kAround; ++v) {
    const bool at_edge = v < kAround || v >= (kRows - 1) * kAround;
    ASSERT_EQ(hitched_.at_edge[v], at_edge ? 1 : 0) << v;
  }
}

TEST_F(HitchedClothTest, AShankFarOutHasTheHemAboveIt) {
  for (const float knee : {1.5f, 1.65f, 1.8f}) {
    Lift(0, knee);
    const std::vector<float> drawn = Skirt(0), skirt = HitchedUp(drawn);
    EXPECT_GT(CrossedBy(drawn), 0) << knee;
    EXPECT_EQ(CrossedBy(skirt), 0) << knee;
    EXPECT_LT(Nearest(drawn), 0.01f) << knee;
    EXPECT_GT(Nearest(skirt), kArm) << knee;
  }
}

// It lies where there was cloth.
TEST_F(HitchedClothTest, ClothSlidesAlongItself) {
  Lift(0, 1.8f);
  const std::vector<float> drawn = Skirt(0.3f), skirt = HitchedUp(drawn);
  size_t moved = 0;
  for (size_t i = 0; i < skirt.size(); i += 3) {
    if (skirt[i + 1] == drawn[i + 1]) continue;
    ++moved;
    ASSERT_GT(skirt[i + 1], drawn[i + 1]) << i;
    ASSERT_LE(skirt[i + 1], 0) << i;
    ASSERT_NEAR(std::hypot(skirt[i], skirt[i + 2] - 0.3f * skirt[i + 1]), kSkirt, 0.001f) << i;
  }
  EXPECT_GT(moved, 1000u);
  EXPECT_LT(moved, kRows * kAround / 2) << "the front stays";
}

// Less and less to the sides: no edge of a triangle is three times as long as before.
TEST_F(HitchedClothTest, TheHemRisesSmoothly) {
  Lift(0, 1.8f);
  const std::vector<float> drawn = Skirt(0), skirt = HitchedUp(drawn);
  float longest = 0;
  for (size_t t = 0; t < faces_.size(); ++t) {
    const size_t a = 3 * faces_[t], b = 3 * faces_[t / 3 * 3 + (t + 1) % 3];
    const auto length = [&](const std::vector<float>& of) {
      return std::hypot(of[b] - of[a], of[b + 1] - of[a + 1], of[b + 2] - of[a + 2]);
    };
    longest = std::fmax(longest, length(skirt) / length(drawn));
  }
  EXPECT_LT(longest, 3);
}

TEST_F(HitchedClothTest, WhatWasLaidGoesBackFirst) {
  Lift(0, 1.8f);
  const std::vector<float> drawn = Skirt(0), skirt = HitchedUp(drawn);
  std::vector<float> laid = drawn;
  for (size_t i = 0; i < laid.size(); i += 3) laid[i + 2] += laid[i + 2] > 0 ? 0.1f : 0.0f;
  ASSERT_TRUE(HitchUp(drawn, &laid));
  EXPECT_EQ(laid, skirt);
}

// What KeepOutside asks for: the limbs that laying left torn or pierced, and no others.
TEST_F(HitchedClothTest, LayingSaysWhichLimbsToAskFor) {
  Lift(0, 1.8f);
  std::vector<float> skirt = Skirt(0);
  EXPECT_EQ(LayOrSweep(&skirt), kLeg);
  Lift(0.3f, 0.3f);
  skirt = Skirt(0);
  EXPECT_EQ(LayOrSweep(&skirt), 0);
}

TEST_F(HitchedClothTest, NothingMovesWhereNothingIsToBeHitchedUp) {
  const auto expect_same = [this](uint8_t torn, const char* why) {
    const std::vector<float> drawn = Skirt(0);
    std::vector<float> laid = drawn;
    for (float& x : laid) x += 0.001f;
    const std::vector<float> before = laid;
    EXPECT_FALSE(HitchUp(drawn, &laid, false, torn)) << why;
    EXPECT_EQ(laid, before) << why;
  };
  Lift(0, 1.8f);
  expect_same(0, "of a limb that tore nothing nothing is asked");
  Lift(0.3f, 0.3f);
  expect_same(kLeg, "the leg is inside");
  Lift(0, 2.2f);
  expect_same(kLeg, "the hem is too far");
}

TEST_F(HitchedClothTest, MirroredSpacesGiveTheMirrorImage) {
  Lift(0, 1.8f);
  std::vector<float> skirt = Skirt(0), host = skirt;
  ASSERT_TRUE(HitchUp(skirt, &skirt));
  MirrorSpace(&host);
  ASSERT_TRUE(HitchUp(host, &host, true));
  for (size_t i = 0; i < host.size(); ++i) ASSERT_NEAR(0.01f * host[i] * (i % 3 == 0 ? -1.0f : 1.0f), skirt[i], 1e-4f);
}

TEST_F(HitchedClothTest, BrokenPosesEnd) {
  Lift(0, 1.8f);
  ExpectBrokenPosesEnd([this](std::vector<float>* skirt) { HitchUp(*skirt, skirt); });
}

}  // namespace
}  // namespace dcloth::testing
