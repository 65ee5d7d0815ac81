// A foot that was drawn through the back of its skirt takes the skirt along.
#include "engine/src/body/kicked_cloth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/engine/body/limbs.h"

namespace dcloth::testing {
namespace {

class KickedClothTest : public LegInSkirt {
 protected:
  void TakeAlong(std::vector<float>* skirt, bool mirrored = false) {
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::Surface surface = {};
    surface.positions = skirt->data();
    surface.position_stride_bytes = 12;
    moved_ = engine::TakeAlong(model_, mirrored, Skin().data(), limbs_, swept_, surface);
  }

  std::vector<float> Skin() const {
    std::vector<float> skin(body_.size());
    for (size_t i = 0; i < body_.size(); ++i) {
      const float* row = &matrices_[size_t{12} * body_joints_[i / 3] + 4 * (i % 3)];
      skin[i] = engine::Dot(row, &body_[i - i % 3]) + row[3];
    }
    return skin;
  }

  std::vector<float> Taken(float hip, float knee) {
    Lift(hip, knee);
    std::vector<float> skirt = Skirt(0);
    TakeAlong(&skirt);
    return skirt;
  }

  // How far behind the hip something is, at most.
  static float Back(const std::vector<float>& skirt) {
    float back = 0;
    for (size_t i = 2; i < skirt.size(); i += 3) back = std::fmax(back, -skirt[i]);
    return back;
  }

  bool moved_ = false;
};

TEST_F(KickedClothTest, AFootThroughTheBackTakesItAlong) {
  for (const float knee : {1.8f, 2.0f, 2.2f}) {
    const std::vector<float> skirt = Taken(0.5f, knee), before = Skirt(0);
    EXPECT_TRUE(moved_) << knee;
    const float foot = (kLength + kFoot) * std::sin(knee - 0.5f) - kLength * std::sin(0.5f);
    EXPECT_GT(foot, kSkirt + 0.05f) << knee;
    EXPECT_GT(CrossedBy(before), 0) << knee;
    EXPECT_EQ(CrossedBy(skirt), 0) << knee;
    EXPECT_GT(Back(skirt), foot) << knee;
    EXPECT_LT(Back(skirt), foot + 0.03f) << knee;
    for (size_t i = 0; i < skirt.size(); i += 3) {
      for (size_t c = 0; c < 3 && before[i + 2] > 0; ++c) ASSERT_EQ(skirt[i + c], before[i + c]) << "the front stays";
    }
  }
}

// It is 0.15 m long, and comes out by less than 0.04 m.
TEST_F(KickedClothTest, AFootThatHangsDownAlongTheBackTakesItAway) {
  Lift(-0.9f, 0);
  std::vector<float> skirt = Skirt(0.82f);
  const std::vector<float> before = skirt;
  TakeAlong(&skirt);
  EXPECT_GT(CrossedBy(before), 0);
  EXPECT_EQ(CrossedBy(skirt), 0);
  float furthest = 0;
  for (size_t i = 0; i < skirt.size(); i += 3) {
    furthest = std::fmax(furthest,
                         std::hypot(skirt[i] - before[i], skirt[i + 1] - before[i + 1], skirt[i + 2] - before[i + 2]));
  }
  EXPECT_GT(furthest, 0.04f);
  EXPECT_LT(furthest, 0.13f);
  EXPECT_GT(Back(skirt), Back(Skin())) << "its side is 0.05 m further out";
}

// To the left of the foot's bone the panel lies 0.03 m further in.
TEST_F(KickedClothTest, APleatBesideTheFootGoesAsFar) {
  Lift(0.5f, 2);
  std::vector<float> skirt = Skirt(0);
  const auto in_pleat = [&](size_t i) { return bound_[i] < -0.015f && bound_[i] > -0.035f && bound_[i + 2] < 0; };
  for (size_t i = 0; i < skirt.size(); i += 3) skirt[i + 2] += in_pleat(i) ? 0.03f : 0.0f;
  TakeAlong(&skirt);
  const float toes = Back(Skin());
  size_t over = 0;
  for (size_t i = 0; i < skirt.size(); i += 3) over += in_pleat(i) && -skirt[i + 2] > toes;
  EXPECT_GT(over, 5u);
}

// No slope is steeper than the cloth can be stretched to.
TEST_F(KickedClothTest, ClothAroundGoesAlongLessAndLess) {
  const std::vector<float> skirt = Taken(0.5f, 2), before = Skirt(0);
  float longest = 0;
  for (size_t t = 0; t < faces_.size(); t += 3) {
    for (size_t k = 0; k < 3; ++k) {
      const size_t a = 3 * faces_[t + k], b = 3 * faces_[t + (k + 1) % 3];
      const auto length = [&](const std::vector<float>& of) {
        return std::hypot(of[b] - of[a], of[b + 1] - of[a + 1], of[b + 2] - of[a + 2]);
      };
      longest = std::fmax(longest, length(skirt) / length(before));
    }
  }
  EXPECT_GT(longest, 1.2f);
  EXPECT_LT(longest, 2);
}

TEST_F(KickedClothTest, ToesThatJustComeOutTakeLittleAlong) {
  Lift(0.5f, 2);
  std::vector<float> skirt = Skirt(0.34f);
  const std::vector<float> before = skirt;
  TakeAlong(&skirt);
  float furthest = 0;
  for (size_t i = 0; i < skirt.size(); i += 3) furthest = std::fmax(furthest, std::fabs(skirt[i + 2] - before[i + 2]));
  EXPECT_GT(furthest, 0.001f);
  EXPECT_LT(furthest, 0.015f);
}

TEST_F(KickedClothTest, ALegInsideLeavesTheSkirtAlone) {
  for (const float knee : {0.0f, 0.6f, 1.5f}) {
    EXPECT_EQ(Taken(0.5f, knee), Skirt(0)) << knee;
    EXPECT_FALSE(moved_) << knee;
  }
}

TEST_F(KickedClothTest, ALegThatIsFarOutDoesToo) { EXPECT_EQ(Taken(0, 1.8f), Skirt(0)); }

// The knee is out in front, and the foot back in.
TEST_F(KickedClothTest, AFootThatComesInDoesToo) {
  Lift(1.5f, 1.95f);
  ASSERT_GT(CrossedBy(Taken(1.5f, 1.95f)), 0);
  EXPECT_EQ(Taken(1.5f, 1.95f), Skirt(0));
}

// Below where the leg comes out, the back stands off as far as takes the foot in again.
TEST_F(KickedClothTest, AFootThatGoesInAgainDoesToo) {
  Lift(0.5f, 1.8f);
  std::vector<float> skirt = Skirt(0);
  for (size_t i = 0; i < skirt.size(); i += 3) {
    const float below = -0.47f - skirt[i + 1];
    if (skirt[i + 2] < 0 && below > 0) skirt[i + 2] -= std::fmin(10 * below, 0.2f);
  }
  const std::vector<float> before = skirt;
  TakeAlong(&skirt);
  EXPECT_EQ(CrossedBy(before), 2);
  EXPECT_EQ(skirt, before);
}

// The knee is out in front, and the shank hangs down along the front, which bulges over a piece of it.
TEST_F(KickedClothTest, ALegThatLiesOnTheClothDoesToo) {
  Lift(1.2f, 1.2f);
  std::vector<float> skirt = Skirt(0);
  const float shank = kLength * std::sin(1.2f), foot = -kLength * std::cos(1.2f) - kLength;
  for (size_t i = 0; i < skirt.size(); i += 3) {
    const float off = std::fabs(skirt[i + 1] - foot);
    if (skirt[i + 2] > 0 && off < 0.04f) skirt[i + 2] += (shank - kSkirt + 0.02f) * std::fmin(1, 2 - off / 0.02f);
  }
  const std::vector<float> before = skirt;
  TakeAlong(&skirt);
  EXPECT_EQ(CrossedBy(before), 3) << "the thigh comes out, the foot goes in and out";
  EXPECT_EQ(skirt, before);
}

TEST_F(KickedClothTest, MirroredSpacesGiveTheMirrorImage) {
  std::vector<float> skirt = Taken(0.5f, 2), host = Skirt(0);
  EXPECT_NE(skirt, host);
  MirrorSpace(&host);
  TakeAlong(&host, true);
  for (size_t i = 0; i < host.size(); ++i) ASSERT_NEAR(0.01f * host[i] * (i % 3 == 0 ? -1.0f : 1.0f), skirt[i], 1e-5f);
}

TEST_F(KickedClothTest, BrokenPosesEnd) {
  Lift(0.5f, 2);
  ExpectBrokenPosesEnd([this](std::vector<float>* skirt) { TakeAlong(skirt); });
}

}  // namespace
}  // namespace dcloth::testing
