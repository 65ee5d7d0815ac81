// Cloth with spikes is drawn together, and stays out of the leg.
#include "engine/src/body/stretched_cloth.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <set>
#include <vector>

#include "tests/unit/engine/body/limbs.h"

namespace dcloth::testing {
namespace {

constexpr uint8_t kLeg = 1;  // bit

class StretchedClothTest : public LegInSkirt {
 protected:
  // Returns how many vertices were listed; `listed` are they.
  size_t DrawTogether(uint8_t torn, std::vector<float>* skirt, std::set<size_t>* listed = nullptr) {
    engine::PoseLimbCores(matrices_.data(), limbs_);
    engine::Surface surface = {};
    surface.positions = skirt->data();
    surface.position_stride_bytes = 12;
    const size_t found = engine::ListStretched(model_, limbs_, torn, swept_, surface);
    const size_t triangles = engine::ListTriangles(model_, swept_.places, swept_.places, deep_.triangles);
    engine::DrawTogether(model_, limbs_, torn, swept_, found, deep_.triangles, triangles, deep_.sums, surface);
    if (listed != nullptr) listed->insert(swept_.vertices, swept_.vertices + found);
    for (size_t i = 0; i < found; ++i) swept_.places[swept_.vertices[i]] = engine::kNotDeep;
    return found;
  }

  // Every `step`th vertex of the rows from `first` to `last` is pulled out by `length`.
  std::vector<float> WithSpikes(size_t first, size_t last, size_t step, float length) const {
    std::vector<float> skirt = bound_;
    for (size_t v = first * kAround; v < last * kAround; v += step) {
      skirt[3 * v] *= 1 + length / kSkirt;
      skirt[3 * v + 2] *= 1 + length / kSkirt;
    }
    return skirt;
  }

  float LongestEdge(const std::vector<float>& skirt) const {
    float longest = 0;
    for (size_t t = 0; t < faces_.size(); t += 3) {
      for (size_t k = 0; k < 3; ++k) {
        const size_t a = faces_[t + k], b = faces_[t + (k + 1) % 3];
        float apart[3], bound[3];
        for (size_t c = 0; c < 3; ++c) {
          apart[c] = skirt[3 * a + c] - skirt[3 * b + c];
          bound[c] = bound_[3 * a + c] - bound_[3 * b + c];
        }
        const float ratio = std::sqrt(engine::Dot(apart, apart) / engine::Dot(bound, bound));
        longest = ratio > longest ? ratio : longest;
      }
    }
    return longest;
  }

  int InCores(const std::vector<float>& skirt) const {
    int count = 0;
    for (size_t v = 0; v < order_.size(); ++v) {
      for (uint32_t k = 0; k < *limbs_.count; ++k) {
        float away[3], radius;
        count += engine::IsInCore(limbs_.cores[k], &skirt[3 * v], away, &radius) ? 1 : 0;
      }
    }
    return count;
  }
};

TEST_F(StretchedClothTest, SpikesAreDrawnIn) {
  std::vector<float> skirt = WithSpikes(30, 34, 7, 0.15f);
  const float before = LongestEdge(skirt);
  ASSERT_GT(before, 12);
  EXPECT_GT(DrawTogether(kLeg, &skirt), 0u);
  EXPECT_LT(LongestEdge(skirt), before / 6);
}

TEST_F(StretchedClothTest, OnlyClothAroundThemMoves) {
  const std::vector<float> drawn = WithSpikes(30, 31, kAround, 0.15f);
  std::vector<float> skirt = drawn;
  std::set<size_t> listed;
  DrawTogether(kLeg, &skirt, &listed);
  EXPECT_EQ(listed.size(), 91u) << "the spike and five rings around it";
  for (size_t v = 0; v < order_.size(); ++v) {
    const bool same = std::memcmp(&skirt[3 * v], &drawn[3 * v], 3 * sizeof(float)) == 0;
    EXPECT_TRUE(same || listed.count(v) != 0) << v;
  }
}

TEST_F(StretchedClothTest, ClothAsLongAsInTheBindPoseKeepsItsBits) {
  std::vector<float> skirt = bound_;
  EXPECT_EQ(DrawTogether(kLeg, &skirt), 0u);
  EXPECT_EQ(skirt, bound_);
}

TEST_F(StretchedClothTest, ClothOfOtherLimbsKeepsItsBits) {
  const std::vector<float> drawn = WithSpikes(30, 34, 7, 0.15f);
  std::vector<float> skirt = drawn;
  EXPECT_EQ(DrawTogether(0, &skirt), 0u);
  EXPECT_EQ(DrawTogether(2, &skirt), 0u);
  EXPECT_EQ(skirt, drawn);
}

// The skirt lies on a lifted leg, and half of it hangs far below; drawn together it would come through the thigh.
TEST_F(StretchedClothTest, ClothStaysOutOfTheLeg) {
  Lift(1.5f, 0);
  std::vector<float> skirt = Skirt(0);
  LayOrSweep(&skirt);
  for (size_t v = 0; v < order_.size(); ++v) {
    if (bound_[3 * v + 2] < -0.1f) skirt[3 * v + 1] -= 0.2f;
  }
  ASSERT_EQ(InCores(skirt), 0);
  EXPECT_GT(DrawTogether(kLeg, &skirt), 500u);
  EXPECT_EQ(InCores(skirt), 0);
}

TEST_F(StretchedClothTest, MirroredSpaceInCentimetresDoesTheSame) {
  Lift(0.9f, 1);
  std::vector<float> skirt = WithSpikes(30, 34, 7, 0.15f), mirrored = skirt;
  DrawTogether(kLeg, &skirt);
  MirrorSpace(&mirrored);
  DrawTogether(kLeg, &mirrored);
  for (size_t i = 0; i < skirt.size(); ++i) {
    ASSERT_NEAR(mirrored[i], skirt[i] * (i % 3 == 0 ? -100.0f : 100.0f), 0.01f) << i;
  }
}

TEST_F(StretchedClothTest, BrokenPosesEnd) {
  ExpectBrokenPosesEnd([&](std::vector<float>* skirt) { DrawTogether(kLeg, skirt); });
}

}  // namespace
}  // namespace dcloth::testing
