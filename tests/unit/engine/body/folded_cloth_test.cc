// A fold on flat skin: cloth with its lining up, and cloth over it with its outer side up.
#include "engine/src/body/folded_cloth.h"

#include <gtest/gtest.h>

#include <array>
#include <vector>

#include "engine/src/body/deep_cloth.h"

namespace dcloth::engine {
namespace {

constexpr float kClearance = 0.004f;

class FoldedClothTest : public ::testing::Test {
 protected:
  FoldedClothTest() {
    model_.vertex_count = 6;
    model_.triangle_count = 2;
    model_.faces = cloth_faces_.data();
    model_.body.positions = body_.data();
    model_.body.vertex_count = 4;
    model_.body.faces = body_faces_.data();
    model_.body.face_count = 2;
    model_.body.row_starts = row_starts_.data();
    model_.body.columns = columns_.data();
  }

  // The triangle of lining `lining` above the skin, the other `over` above it, in metres.
  void LayAt(float lining, float over) {
    cloth_ = {0.2f, lining, 0.2f, 0.8f, lining, 0.2f, 0.2f, lining, 0.8f,
              0.2f, over,   0.2f, 0.2f, over,   0.8f, 0.8f, over,   0.2f};
  }

  size_t Lift(double outward = 1) {
    const Surface surface = {cloth_.data(), 3 * sizeof(float), nullptr, 0, nullptr, 0};
    places_.assign(model_.vertex_count, 7);
    std::vector<float> tops(model_.body.vertex_count);
    return LiftOverLining(model_, {&model_.body, body_.data(), outward, 0}, normals_.data(), beside_.data(), kClearance,
                          places_.data(), tops.data(), surface);
  }

  float HeightOf(size_t vertex) const { return cloth_[3 * vertex + 1]; }

  // A square of skin, seen from above.
  std::vector<float> body_ = {0, 0, 0, 1, 0, 0, 0, 0, 1, 1, 0, 1};
  std::vector<float> normals_ = {0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
  std::vector<uint16_t> body_faces_ = {0, 2, 1, 1, 2, 3};
  std::vector<uint32_t> row_starts_ = {0, 1, 3, 5, 6};
  std::vector<uint16_t> columns_ = {0, 0, 1, 0, 1, 1};
  std::vector<uint16_t> cloth_faces_ = {0, 1, 2, 3, 4, 5};
  std::array<uint16_t, 6> beside_ = {0, 1, 2, 0, 2, 1};
  std::vector<float> cloth_;
  std::vector<uint16_t> places_;
  format::ModelView model_ = {};
};

TEST_F(FoldedClothTest, ClothIsLiftedAClearanceOverLining) {
  LayAt(kClearance, kClearance);
  EXPECT_EQ(Lift(), 3u);
  for (size_t v = 0; v < 3; ++v) {
    EXPECT_FLOAT_EQ(HeightOf(v), kClearance) << "lining " << v;
    EXPECT_EQ(places_[v], kNotDeep) << "lining " << v;
  }
  for (size_t v = 3; v < 6; ++v) {
    EXPECT_FLOAT_EQ(HeightOf(v), 2 * kClearance) << "vertex " << v;
    EXPECT_NE(places_[v], kNotDeep) << "vertex " << v;
  }
}

TEST_F(FoldedClothTest, ClothThatIsHigherStays) {
  LayAt(kClearance, 2.5f * kClearance);
  const std::vector<float> before = cloth_;
  EXPECT_EQ(Lift(), 0u);
  EXPECT_EQ(cloth_, before);
  for (const uint16_t place : places_) EXPECT_EQ(place, kNotDeep);
}

TEST_F(FoldedClothTest, ClothBesideOtherSkinStays) {
  // Lining touches one corner of the square, cloth the one that no face has in common with it.
  LayAt(kClearance, kClearance);
  beside_ = {0, 0, 0, 3, 3, 3};
  const std::vector<float> before = cloth_;
  Lift();
  EXPECT_EQ(cloth_, before);
}

TEST_F(FoldedClothTest, LiningThatHangsFreeLiftsNothing) {
  LayAt(8.5f * kClearance, kClearance);
  const std::vector<float> before = cloth_;
  Lift();
  EXPECT_EQ(cloth_, before);
}

TEST_F(FoldedClothTest, ClothThatWasGivenUpDeepInTheBodyStays) {
  LayAt(kClearance, -7 * kClearance);
  const std::vector<float> before = cloth_;
  Lift();
  EXPECT_EQ(cloth_, before);
}

TEST_F(FoldedClothTest, ClothFarFromSkinIsNeitherLiftedNorLining) {
  LayAt(kClearance, kClearance);
  const std::vector<float> before = cloth_;
  beside_ = {kNotNear, kNotNear, kNotNear, 0, 2, 1};
  Lift();
  EXPECT_EQ(cloth_, before) << "lining far from the skin lifted cloth";
  beside_ = {0, 1, 2, kNotNear, kNotNear, kNotNear};
  Lift();
  EXPECT_EQ(cloth_, before) << "cloth far from the skin was lifted";
}

TEST_F(FoldedClothTest, AMirroredSpaceTurnsTheSides) {
  LayAt(kClearance, kClearance);
  Lift(-1);
  for (size_t v = 0; v < 3; ++v) EXPECT_FLOAT_EQ(HeightOf(v), 2 * kClearance) << "vertex " << v;
  for (size_t v = 3; v < 6; ++v) EXPECT_FLOAT_EQ(HeightOf(v), kClearance) << "lining " << v;
}

}  // namespace
}  // namespace dcloth::engine
