// The surface that stands for a character's body, where pushes along normals have folded it.
#include "fit/body_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/unit/engine/test_body.h"

namespace dcloth::fit {
namespace {

using testing::EggBody;

class UntangleTest : public ::testing::Test {
 protected:
  UntangleTest() {
    testing::TestModel model = testing::BuildModel({});
    egg_ = testing::AddBody(&model, kRings, kSegments);
    normals_.assign(egg_.positions.size(), 0.0f);
    for (size_t f = 0; f < egg_.faces.size(); f += 3) {
      const auto area = AreaOf(egg_.positions, f);
      for (size_t k = 0; k < 3; ++k) {
        for (size_t c = 0; c < 3; ++c) normals_[3 * size_t{egg_.faces[f + k]} + c] += static_cast<float>(area[c]);
      }
    }
    for (size_t v = 0; v < normals_.size(); v += 3) {
      const float length = std::hypot(normals_[v], normals_[v + 1], normals_[v + 2]);
      for (size_t c = 0; c < 3; ++c) normals_[v + c] /= length;
    }
  }

  std::vector<double> AreaOf(const std::vector<float>& positions, size_t face) const {
    double corner[3][3], area[3];
    for (size_t i = 0; i < 9; ++i)
      corner[i / 3][i % 3] = static_cast<double>(positions[3 * size_t{egg_.faces[face + i / 3]} + i % 3]);
    for (size_t i = 0; i < 3; ++i) {
      const size_t j = (i + 1) % 3, k = (i + 2) % 3;
      area[i] = (corner[1][j] - corner[0][j]) * (corner[2][k] - corner[0][k]) -
                (corner[1][k] - corner[0][k]) * (corner[2][j] - corner[0][j]);
    }
    return {area[0], area[1], area[2]};
  }

  size_t FacesTurnedOver(const std::vector<float>& positions) const {
    size_t count = 0;
    for (size_t f = 0; f < egg_.faces.size(); f += 3) {
      const auto area = AreaOf(positions, f);
      double along = 0;
      for (size_t i = 0; i < 9; ++i)
        along += area[i % 3] * static_cast<double>(normals_[3 * size_t{egg_.faces[f + i / 3]} + i % 3]);
      count += along < 0 ? 1 : 0;
    }
    return count;
  }

  std::vector<float> Untangled(std::vector<float> positions) const {
    const size_t n = positions.size() / 3;
    std::vector<uint8_t> turned(n);
    std::vector<float> axis(n), sums(n);
    std::vector<uint32_t> counts(n);
    Untangle({egg_.faces.data(), static_cast<uint32_t>(egg_.faces.size() / 3), static_cast<uint32_t>(n),
              normals_.data(), positions.data(), turned.data(), axis.data(), sums.data(), counts.data()});
    return positions;
  }

  static constexpr uint32_t kRings = 28, kSegments = 30;
  EggBody egg_;
  std::vector<float> normals_;
};

TEST_F(UntangleTest, SoundSurfacesStay) { EXPECT_EQ(Untangled(egg_.positions), egg_.positions); }

// Two meridians beside each other that crossed, as the walls of a groin do; what is far from them stays.
TEST_F(UntangleTest, LaysCrossedWallsAmongTheirNeighbours) {
  std::vector<float> crossed = egg_.positions;
  for (uint32_t ring = 8; ring < 20; ++ring) {
    for (size_t c = 0; c < 3; ++c) {
      const size_t a = 3 * (size_t{ring} * kSegments + 10) + c, b = a + 3;
      const float between = egg_.positions[b] - egg_.positions[a];
      crossed[a] += 1.5f * between;
      crossed[b] -= 1.5f * between;
    }
  }
  ASSERT_GE(FacesTurnedOver(crossed), 20u);
  const std::vector<float> untangled = Untangled(crossed);
  EXPECT_EQ(FacesTurnedOver(untangled), 0u);
  for (size_t i = 0; i < untangled.size(); ++i) {
    ASSERT_NEAR(untangled[i], egg_.positions[i], 0.06f) << i;
    if (i / 3 % kSegments >= 20) {
      ASSERT_EQ(untangled[i], egg_.positions[i]) << i;
    }
  }
}

}  // namespace
}  // namespace dcloth::fit
