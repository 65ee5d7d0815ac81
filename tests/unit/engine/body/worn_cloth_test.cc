// Cloth as a limb wears it: the garment bent around the limb as that is posed.
#include "engine/src/body/worn_cloth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "tests/unit/engine/body/limbs.h"

namespace dcloth::testing {
namespace {

class WornClothTest : public LegInSkirt {
 protected:
  std::vector<float> Worn(float hip, float knee) {
    Lift(hip, knee);
    return Worn(limbs_);
  }
  std::vector<float> Worn(const engine::LimbCores& limbs) {
    engine::PoseLimbCores(matrices_.data(), limbs);
    engine::Limb limb;
    EXPECT_TRUE(engine::FillLimb(model_, matrices_.data(), limbs, 0, 1, &limb));
    const engine::WornCloth worn(model_, matrices_.data(), limbs, limb);
    std::vector<float> skirt(bound_.size());
    for (size_t v = 0; v < order_.size(); ++v) worn.Place(v, &skirt[3 * v]);
    return skirt;
  }

  // Metres, of vertices between two heights, from where joint `joint` alone would take them.
  float Apart(const std::vector<float>& skirt, size_t joint, float low, float high) const {
    float most = 0;
    for (size_t v = 0; v < order_.size(); ++v) {
      if (bound_[3 * v + 1] < low || bound_[3 * v + 1] > high) continue;
      float at[3], squared = 0;
      engine::Transform(&matrices_[12 * joint], &bound_[3 * v], at);
      for (size_t c = 0; c < 3; ++c) squared += (skirt[3 * v + c] - at[c]) * (skirt[3 * v + c] - at[c]);
      most = std::max(most, std::sqrt(squared));
    }
    return most;
  }
};

TEST_F(WornClothTest, InTheBindPoseIsTheGarment) {
  const std::vector<float> skirt = Worn(0, 0);
  for (size_t i = 0; i < skirt.size(); ++i) ASSERT_NEAR(skirt[i], bound_[i], 1e-6f);
}

// Bent further, so wide a skirt folds into itself behind the knee and above the hip.
TEST_F(WornClothTest, NoBoneGoesThroughIt) {
  for (const float hip : {-0.6f, 0.3f, 0.9f, 1.5f}) {
    for (const float knee : {0.0f, 0.5f, 1.0f, 1.5f}) EXPECT_EQ(CrossedBy(Worn(hip, knee)), 0) << hip << " " << knee;
  }
}

TEST_F(WornClothTest, GoesFromTheHipsToTheThighToTheShank) {
  const std::vector<float> skirt = Worn(0.8f, 1.2f);
  EXPECT_LT(Apart(skirt, 0, -0.001f, 1), 1e-5f) << "at the hip: the joint above";
  EXPECT_LT(Apart(skirt, 1, -0.33f, -0.11f), 1e-5f) << "beside the thigh";
  EXPECT_LT(Apart(skirt, 2, -1, -0.47f), 1e-5f) << "below the knee";
  EXPECT_GT(Apart(skirt, 1, -0.43f, -0.37f), 0.01f) << "at the knee: in between";
}

// The knee bends about an axis that the hip has turned.
TEST_F(WornClothTest, GoesWithALegThatIsLiftedSideways) {
  Lift(0, 1.2f);
  const float c = std::cos(0.8f), s = std::sin(0.8f);
  for (size_t j = 1; j < 5; ++j) {
    for (size_t k = 0; k < 4; ++k) {
      float *x = &matrices_[12 * j + k], *y = x + 4;
      const float old = *x;
      *x = c * old - s * *y;
      *y = s * old + c * *y;
    }
  }
  const std::vector<float> skirt = Worn(limbs_);
  EXPECT_LT(Apart(skirt, 1, -0.33f, -0.11f), 1e-5f) << "beside the thigh";
  EXPECT_LT(Apart(skirt, 2, -1, -0.47f), 1e-5f) << "below the knee";
}

TEST_F(WornClothTest, ClothOfAnotherLegStays) {
  constexpr float kApart = 0.3f;
  std::vector<engine::LimbCore> cores(limbs_.cores, limbs_.cores + 3);
  for (size_t k = 0; k < 3; ++k) {
    engine::LimbCore other = cores[k];
    other.from[0] += kApart, other.to[0] += kApart;
    for (uint32_t* of : {&other.above, &other.below}) *of = *of < 3 ? *of + 3 : *of;
    cores.push_back(other);
  }
  uint32_t count = 6;
  Lift(0.8f, 0);
  const std::vector<float> alone = Worn(limbs_), beside = Worn(engine::LimbCores{cores.data(), &count});
  int own = 0, others = 0;
  for (size_t v = 0; v < order_.size(); ++v) {
    const float x = bound_[3 * v];
    for (size_t c = 0; c < 3; ++c) {
      if (x < 0.05f) {
        ASSERT_EQ(beside[3 * v + c], alone[3 * v + c]) << v;
      } else if (x > 0.21f) {
        ASSERT_NEAR(beside[3 * v + c], bound_[3 * v + c], 1e-6f) << v;
      }
    }
    own += x < 0.05f;
    others += x > 0.21f;
  }
  EXPECT_GT(own, 100);
  EXPECT_GT(others, 20);
}

// The longest edge is 15 mm where nothing is bent: no jump where one joint's part ends.
TEST_F(WornClothTest, NeighboursStayNeighbours) {
  const std::vector<float> skirt = Worn(1.5f, 2);
  float longest = 0;
  for (size_t t = 0; t < faces_.size(); t += 3) {
    for (size_t k = 0; k < 3; ++k) {
      const float *a = &skirt[3 * faces_[t + k]], *b = &skirt[3 * faces_[t + (k + 1) % 3]];
      longest = std::max(longest, std::hypot(a[0] - b[0], std::hypot(a[1] - b[1], a[2] - b[2])));
    }
  }
  EXPECT_LT(longest, 0.08f);
}

TEST_F(WornClothTest, BrokenPosesEnd) {
  Lift(0.9f, 2);
  ExpectBrokenPosesEnd([this](std::vector<float>* skirt) {
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::Limb limb;
    if (!engine::FillLimb(model_, matrices_.data(), limbs_, 0, 1, &limb)) return;
    const engine::WornCloth worn(model_, matrices_.data(), limbs_, limb);
    float at[3];
    for (size_t v = 0; v < order_.size(); ++v) worn.Place(v, at);
    (void)skirt;
  });
}

}  // namespace
}  // namespace dcloth::testing
