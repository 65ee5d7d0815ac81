// A toe through a sheet of cloth, between its vertices.
#include "engine/src/body/crossings.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <vector>

#include "engine/src/body/triangle_crossing.h"
#include "tests/unit/engine/body/sheet.h"

namespace dcloth::engine {
namespace {

constexpr size_t kSide = 21;
constexpr float kSpacing = 0.01f;
constexpr double kClearance = 0.004;
constexpr uint32_t kPlenty = 1u << 20;
constexpr size_t kAround = 8;

// Cloth of kSide x kSide vertices at height 0, in the middle of a square of which a toe's tip is.
class CrossingsTest : public ::testing::Test {
 protected:
  CrossingsTest() {
    beside_.assign(sheet_.count(), kNotNear);
    sheet_.ShowTo(&model_);
    for (size_t i = 0; i < kAround; ++i) {
      const auto a = static_cast<uint16_t>(1 + i), b = static_cast<uint16_t>(1 + (i + 1) % kAround);
      body_faces_.insert(body_faces_.end(), {0, b, a});
    }
    rows_.push_back(0);
    for (uint16_t v = 0; v <= kAround; ++v) {
      for (uint16_t f = 0; f < kAround; ++f) {
        for (size_t k = 0; k < 3; ++k) {
          if (body_faces_[3u * f + k] == v) columns_.push_back(f);
        }
      }
      rows_.push_back(static_cast<uint32_t>(columns_.size()));
    }
    format::BodyView* body = &model_.body;
    body->vertex_count = kAround + 1;
    body->face_count = kAround;
    body->faces = body_faces_.data();
    body->row_starts = rows_.data();
    body->columns = columns_.data();
    Arena sizes(nullptr);
    PlaceBodySites(*body, &sizes);
    PlaceDeepCloth(model_, {}, &sizes);
    memory_.resize(sizes.size() + 64);
    const auto address = reinterpret_cast<uintptr_t>(memory_.data());
    Arena arena(memory_.data() + (64 - address % 64) % 64);
    sites_ = PlaceBodySites(*body, &arena);
    deep_ = PlaceDeepCloth(model_, {}, &arena);
  }

  // A cone with its tip `height` over the cloth, as far from three vertices of a triangle as may be.
  void PutToe(float height, float radius, float length = 0.03f) {
    const float x = kSpacing / 3, z = kSpacing / 3;
    body_ = {x, height, z};
    normals_ = {0, 1, 0};
    for (size_t i = 0; i < kAround; ++i) {
      const float turn = 6.2831853f * static_cast<float>(i) / kAround, c = std::cos(turn), s = std::sin(turn);
      body_.insert(body_.end(), {x + radius * c, height - length, z + radius * s});
      const float across = length / std::hypot(length, radius);
      normals_.insert(normals_.end(), {across * c, std::sqrt(1 - across * across), across * s});
    }
    for (size_t v = 0; v < beside_.size(); ++v) {
      if (sheet_.AwayFrom(x, z, v) < 1.5f * kSpacing) beside_[v] = 0;
    }
  }

  uint32_t Run(uint32_t faces = kPlenty, double outward = 1) {
    FillBodySites(model_.body, lists_, body_.data(), normals_.data(), static_cast<float>(kClearance), sites_);
    const Surface surface = {cloth_.data(), 3 * sizeof(float), nullptr, 0, nullptr, 0};
    const CrossedBody body = {
        {&model_.body, body_.data(), outward, 0}, normals_.data(), sites_, lists_, beside_.data(), kClearance};
    Uncross(model_, body, deep_, moves_.data(), surface, &faces);
    return faces;
  }

  size_t CrossingCount() const {
    size_t count = 0;
    for (size_t t = 0; t < model_.triangle_count; ++t) {
      Triangle cloth = {};
      for (size_t k = 0; k < 3; ++k) cloth.corners[k] = VecAt(&cloth_[3u * sheet_.faces[3 * t + k]]);
      cloth.FillNormal();
      for (size_t f = 0; f < kAround; ++f) {
        Triangle skin = {};
        for (size_t k = 0; k < 3; ++k) skin.corners[k] = VecAt(&body_[3u * body_faces_[3 * f + k]]);
        Crossing crossing;
        count += DoCross(cloth, &skin, &crossing) ? 1 : 0;
      }
    }
    return count;
  }

  float HighestAt(float from, float to) const {
    float highest = 0;
    for (size_t v = 0; v < beside_.size(); ++v) {
      const float away = sheet_.AwayFrom(body_[0], body_[2], v);
      if (away >= from && away < to) highest = std::fmax(highest, cloth_[3 * v + 1]);
    }
    return highest;
  }

  const Sheet sheet_{kSide, kSpacing};
  std::vector<float> cloth_ = sheet_.positions, body_, normals_;
  std::vector<float> moves_ = std::vector<float>(3 * kMostDeep);
  std::vector<uint16_t> body_faces_, columns_, beside_;
  std::vector<uint32_t> rows_;
  std::vector<uint8_t> memory_;
  TouchLists lists_ = {};
  BodySites sites_ = {};
  DeepCloth deep_ = {};
  format::ModelView model_ = {};
};

TEST_F(CrossingsTest, AToeBetweenThreeVerticesIsCovered) {
  PutToe(0.003f, 0.004f);
  ASSERT_GT(CrossingCount(), 0u) << "the toe does not show";
  EXPECT_LT(Run(), kPlenty);
  EXPECT_EQ(CrossingCount(), 0u);
  EXPECT_GT(HighestAt(0, 0.009f), 0.002f);
  EXPECT_LT(HighestAt(0, 0.009f), 0.02f);
}

// A fold, no spike.
TEST_F(CrossingsTest, ClothAroundGivesWay) {
  PutToe(0.006f, 0.004f);
  Run();
  EXPECT_EQ(CrossingCount(), 0u);
  const float at = HighestAt(0, 0.009f), next = HighestAt(0.012f, 0.02f), far = HighestAt(0.07f, 1);
  EXPECT_GT(at, next);
  EXPECT_GT(next, 0.1f * at);
  EXPECT_EQ(far, 0);
}

TEST_F(CrossingsTest, ClothThatDoesNotCrossStays) {
  PutToe(-0.0005f, 0.004f);
  Run();
  EXPECT_EQ(cloth_, sheet_.positions);
}

// The leg is through the cloth, and no push brings it back.
TEST_F(CrossingsTest, WhatAFewPushesDoNotBringOutStays) {
  PutToe(0.1f, 0.03f, 0.2f);
  ASSERT_GT(CrossingCount(), 0u);
  Run();
  EXPECT_EQ(cloth_, sheet_.positions);
}

TEST_F(CrossingsTest, AMirroredSpacePushesTheSameWay) {
  PutToe(0.003f, 0.004f);
  Run();
  const std::vector<float> pushed = cloth_;
  cloth_ = sheet_.positions;
  for (size_t f = 0; f < kAround; ++f) std::swap(body_faces_[3 * f + 1], body_faces_[3 * f + 2]);
  Run(kPlenty, -1);
  for (size_t i = 0; i < pushed.size(); ++i) EXPECT_NEAR(cloth_[i], pushed[i], 1e-7f) << i;
}

TEST_F(CrossingsTest, SkinThatIsNotTouchedMayCross) {
  PutToe(0.003f, 0.004f);
  const std::vector<uint8_t> classes(model_.vertex_count, 1);
  std::vector<uint8_t> touched(kAround + 1, 1);  // class 0 alone
  model_.body.touch_classes = classes.data();
  model_.body.touched_by = touched.data();
  std::vector<uint16_t> sites = {0, 1, 2, 3, 4, 5, 6, 7, 8, 8, 8, 8, 8, 8, 8, 8};
  lists_.sites = sites.data();
  Run();
  EXPECT_EQ(cloth_, sheet_.positions);
  touched.assign(kAround + 1, 2);
  Run();
  EXPECT_EQ(CrossingCount(), 0u);
}

TEST_F(CrossingsTest, TheFramesFacesRunOut) {
  PutToe(0.003f, 0.004f);
  EXPECT_EQ(Run(0), 0u);
  EXPECT_EQ(cloth_, sheet_.positions);
}

TEST_F(CrossingsTest, WhatIsNoNumberHarmsNothingElse) {
  PutToe(0.003f, 0.004f);
  cloth_[0] = std::numeric_limits<float>::quiet_NaN();
  beside_[0] = 0;
  Run();
  EXPECT_EQ(CrossingCount(), 0u);
  for (size_t i = 1; i < cloth_.size(); ++i) ASSERT_TRUE(std::isfinite(cloth_[i])) << i;
}

}  // namespace
}  // namespace dcloth::engine
