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
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::Limb limb;
    EXPECT_TRUE(engine::FillLimb(model_, matrices_.data(), limbs_, 0, 1, &limb));
    const engine::WornCloth worn(model_, matrices_.data(), limbs_, limb);
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

// 1.5 m of a turn of 90 degrees are 10 mm a vertex: nothing jumps where one joint's part ends.
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
