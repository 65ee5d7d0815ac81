// Cloth that cuts a corner of the body, on a roof: two faces that meet in a ridge.
#include "engine/src/body/cut_corners.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

namespace dcloth::engine {
namespace {

constexpr double kClearance = 0.004;
constexpr uint32_t kPlenty = 1u << 20;

// The roof's ridge runs along X at height 0, its sides fall at 45 degrees to either side of Z. Cloth: a strip of two
// triangles over the ridge, one vertex on each side in front and behind.
class CutCornersTest : public ::testing::Test {
 protected:
  CutCornersTest() {
    model_.vertex_count = 4;
    model_.triangle_count = 2;
    model_.faces = cloth_faces_.data();
    model_.body.positions = body_.data();
    model_.body.vertex_count = 6;
    model_.body.faces = body_faces_.data();
    model_.body.face_count = 4;
    model_.body.row_starts = row_starts_.data();
    model_.body.columns = columns_.data();
  }

  // Vertices `out` metres from the ridge down each side, a clearance above the skin.
  void LayOver(float out) {
    const float side = out * std::sqrt(0.5f), off = static_cast<float>(kClearance) * std::sqrt(0.5f);
    cloth_ = {-0.01f, -side + off, -side - off, 0.01f, -side + off, -side - off,
              -0.01f, -side + off, side + off,  0.01f, -side + off, side + off};
  }

  void Cover(uint32_t* faces, const std::array<uint16_t, 4>& beside) {
    const Surface surface = {cloth_.data(), 3 * sizeof(float), nullptr, 0, nullptr, 0};
    CoverCorners(model_, {&model_.body, body_.data(), 1.0, 0}, normals_.data(), beside.data(), kClearance,
                 at_edge_.data(), pressed_.data(), surface, faces);
  }

  // Of the middle between two vertices, above the roof.
  double Height(size_t a, size_t b) const {
    const double y = 0.5 * (static_cast<double>(cloth_[3 * a + 1]) + static_cast<double>(cloth_[3 * b + 1]));
    const double z = 0.5 * (static_cast<double>(cloth_[3 * a + 2]) + static_cast<double>(cloth_[3 * b + 2]));
    return (y + std::fabs(z)) * std::sqrt(0.5);
  }

  const float s_ = std::sqrt(0.5f);
  // Ridge, then the gutters: behind (-Z), in front (+Z).
  std::vector<float> body_ = {-1, 0, 0, 1, 0, 0, -1, -1, -1, 1, -1, -1, -1, -1, 1, 1, -1, 1};
  std::vector<float> normals_ = {0, 1, 0, 0, 1, 0, 0, s_, -s_, 0, s_, -s_, 0, s_, s_, 0, s_, s_};
  std::vector<uint16_t> body_faces_ = {0, 1, 2, 1, 3, 2, 0, 4, 1, 1, 4, 5};
  std::vector<uint32_t> row_starts_ = {0, 2, 6, 8, 9, 11, 12};
  std::vector<uint16_t> columns_ = {0, 2, 0, 1, 2, 3, 0, 1, 1, 2, 3, 3};
  std::vector<uint16_t> cloth_faces_ = {0, 2, 1, 1, 2, 3};
  std::vector<float> cloth_;
  std::array<uint8_t, 4> at_edge_ = {};
  std::array<uint16_t, 4> pressed_ = {};
  format::ModelView model_ = {};
  const std::array<uint16_t, 4> sides_ = {2, 3, 4, 5};
};

TEST_F(CutCornersTest, EdgesOverARidgeAreLiftedOut) {
  LayOver(0.02f);
  ASSERT_LT(Height(0, 2), 0) << "the ridge does not show";
  uint32_t faces = kPlenty;
  Cover(&faces, sides_);
  EXPECT_GT(Height(0, 2), 0);
  EXPECT_GT(Height(1, 2), 0);
  EXPECT_LT(faces, kPlenty);
}

// The second triangle has the edge between its third vertex and its first: no other has it the other way round.
TEST_F(CutCornersTest, HemsAreLiftedWhicheverWayTheirTrianglesGo) {
  for (const bool is_hem : {false, true}) {
    LayOver(0.02f);
    at_edge_.fill(is_hem ? 1 : 0);
    const uint16_t faces[] = {1, 2, 3};
    model_.faces = faces;
    model_.triangle_count = 1;
    normals_.assign(18, 0.0f);
    for (const size_t v : {2, 3, 4, 5}) normals_[3 * v + 1] = s_, normals_[3 * v + 2] = v < 4 ? -s_ : s_;
    uint32_t left = kPlenty;
    Cover(&left, {2, 3, kNotNear, 5});
    EXPECT_EQ(Height(1, 3) > 0.5 * kClearance, is_hem);
  }
}

TEST_F(CutCornersTest, ClothThatIsOutsideStays) {
  LayOver(0.001f);
  const std::vector<float> before = cloth_;
  uint32_t faces = kPlenty;
  Cover(&faces, sides_);
  EXPECT_EQ(cloth_, before);
}

TEST_F(CutCornersTest, ALimbThatWentBetweenIsLeftAlone) {
  LayOver(0.1f);  // the ridge is 7 cm above the edge
  const std::vector<float> before = cloth_;
  uint32_t faces = kPlenty;
  Cover(&faces, sides_);
  EXPECT_EQ(cloth_, before);
}

// A heel against a thigh: lifted out of the one, cloth would stand out in a flap, or go into the other. The two sides
// of a foot face away from each other, too; it is to be covered.
TEST_F(CutCornersTest, ClothBetweenLimbsThatFaceEachOtherStaysUnderThem) {
  const std::vector<uint8_t> limbs[] = {{0, 0, 0, 0, 2, 2}, {0, 0, 0, 0, 1, 1}};
  const std::vector<float> weights(6, 1.0f);
  const uint16_t parents[] = {format::kNoParent, 0, format::kNoParent};
  model_.parents = parents;
  model_.body.weights = weights.data();
  model_.body.influences = 1;
  for (size_t v = 2; v < 6; ++v) normals_[3 * v + 1] = 0.1f, normals_[3 * v + 2] = v < 4 ? -0.995f : 0.995f;
  uint32_t faces = kPlenty;
  for (const auto& joints : limbs) {
    model_.body.joints = joints.data();
    LayOver(0.02f);
    const std::vector<float> before = cloth_;
    Cover(&faces, sides_);
    EXPECT_EQ(cloth_ == before, joints[4] == 2) << "of joint " << int{joints[4]};
    LayOver(0.003f);
    const double low = Height(0, 2);
    ASSERT_GT(low, 0);
    Cover(&faces, sides_);
    EXPECT_GT(Height(0, 2), low + 0.25 * kClearance) << "what is above the skin gets its clearance";
  }
}

// Beside it, an edge over the heel alone is in the same place. A thigh that is lifted against the belly is too near.
TEST_F(CutCornersTest, ClothAroundThatBetweenFarLimbsStaysToo) {
  const std::vector<float> weights(6, 1.0f);
  const uint16_t parents[] = {format::kNoParent, 0, 1, 2};
  model_.parents = parents;
  model_.body.weights = weights.data();
  model_.body.influences = 1;
  for (size_t v = 2; v < 6; ++v) normals_[3 * v + 1] = 0.1f, normals_[3 * v + 2] = v < 4 ? -0.995f : 0.995f;
  for (const uint8_t other : {uint8_t{2}, uint8_t{3}}) {
    const std::vector<uint8_t> joints = {0, 0, 0, 0, 1, other};
    model_.body.joints = joints.data();
    LayOver(0.02f);
    const std::vector<float> before = cloth_;
    uint32_t faces = kPlenty;
    Cover(&faces, sides_);
    EXPECT_EQ(cloth_ == before, other == 3) << int{other} << " joints apart";
  }
}

TEST_F(CutCornersTest, VerticesOfWhichNothingIsKnownStay) {
  LayOver(0.02f);
  const std::vector<float> before = cloth_;
  uint32_t faces = kPlenty;
  Cover(&faces, {2, 3, kNotNear, kNotNear});
  EXPECT_TRUE(std::equal(cloth_.begin() + 6, cloth_.end(), before.begin() + 6));
  EXPECT_FALSE(std::equal(cloth_.begin(), cloth_.begin() + 6, before.begin()));
  LayOver(0.02f);
  Cover(&faces, {kNotNear, kNotNear, kNotNear, kNotNear});
  EXPECT_EQ(cloth_, before);
}

TEST_F(CutCornersTest, TheFramesFacesRunOut) {
  LayOver(0.02f);
  const std::vector<float> before = cloth_;
  uint32_t faces = 0;
  Cover(&faces, sides_);
  EXPECT_EQ(cloth_, before);
}

}  // namespace
}  // namespace dcloth::engine
