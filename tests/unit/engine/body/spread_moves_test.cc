// A ball that was under a sheet of cloth: what was in it lies on it now.
#include "engine/src/body/spread_moves.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "tests/unit/engine/body/sheet.h"

namespace dcloth::engine {
namespace {

constexpr float kSpacing = 0.01f;
constexpr float kLeast = 0.008f;

class SpreadMovesTest : public ::testing::Test {
 protected:
  void Use(size_t side) {
    sheet_ = std::make_unique<Sheet>(side, kSpacing);
    cloth_ = sheet_->positions;
    sheet_->ShowTo(&model_);
    Arena sizes(nullptr);
    PlaceDeepCloth(model_, {}, &sizes);
    memory_.resize(sizes.size() + 64);
    const auto address = reinterpret_cast<uintptr_t>(memory_.data());
    Arena arena(memory_.data() + (64 - address % 64) % 64);
    deep_ = PlaceDeepCloth(model_, {}, &arena);
    for (size_t v = 0; v < sheet_->count(); ++v) deep_.places[v] = kNotDeep;
    listed_ = 0;
  }

  Surface surface() { return {cloth_.data(), 3 * sizeof(float), nullptr, 0, nullptr, 0}; }

  // Of a ball that reaches `height` over the sheet.
  void LayOverBall(float x, float z, float radius, float height) {
    for (size_t v = 0; v < sheet_->count(); ++v) {
      const float away = sheet_->AwayFrom(x, z, v);
      const float up = away < radius ? std::sqrt(radius * radius - away * away) - radius + height : 0.0f;
      Lift(v, std::fmax(up, 0.0f));
    }
  }

  void Lift(size_t vertex, float up) {
    const float* start = &sheet_->positions[3 * vertex];
    cloth_[3 * vertex + 1] += up;
    listed_ = ListMove(deep_, listed_, static_cast<uint16_t>(vertex), start, surface());
  }

  float HeightOf(size_t vertex) const { return cloth_[3 * vertex + 1]; }

  // How sharply the sheet turns along a row through its middle, at most: metres of a second difference upwards.
  float SharpestCrease() const {
    const auto side = static_cast<size_t>(std::lround(std::sqrt(static_cast<double>(sheet_->count()))));
    float sharpest = 0;
    for (size_t c = 1; c + 1 < side; ++c) {
      const size_t v = side / 2 * side + c;
      sharpest = std::fmax(sharpest, HeightOf(v - 1) + HeightOf(v + 1) - 2 * HeightOf(v));
    }
    return sharpest;
  }

  std::unique_ptr<Sheet> sheet_;
  std::vector<float> cloth_, moves_ = std::vector<float>(3 * kMostDeep);
  std::vector<uint8_t> memory_;
  DeepCloth deep_ = {};
  format::ModelView model_ = {};
  size_t listed_ = 0;
};

TEST_F(SpreadMovesTest, ABallIsNotPrintedOnTheSheet) {
  Use(31);
  LayOverBall(0, 0, 0.05f, 0.03f);
  const std::vector<float> before = cloth_;
  const float crease = SharpestCrease();
  const size_t moved = listed_, listed = SpreadLongMoves(model_, deep_, listed_, kLeast, moves_.data(), surface());
  EXPECT_GT(listed, moved);
  EXPECT_LT(SharpestCrease(), 0.5f * crease);
  for (size_t v = 0; v < sheet_->count(); ++v) {
    EXPECT_GE(HeightOf(v), before[3 * v + 1]) << v;
    if (sheet_->AwayFrom(0, 0, v) > 0.12f) {
      EXPECT_EQ(HeightOf(v), 0) << v;
    }
  }
}

// Nothing is drawn over a ball that hardly reaches through, and a little more changes little.
TEST_F(SpreadMovesTest, ClothDoesNotJumpWhereAMoveGetsLong) {
  for (const float height : {kLeast, 1.001f * kLeast}) {
    Use(31);
    LayOverBall(0, 0, 0.05f, height);
    const std::vector<float> before = cloth_;
    const size_t listed = SpreadLongMoves(model_, deep_, listed_, kLeast, moves_.data(), surface());
    EXPECT_EQ(listed != 0, height > kLeast);
    for (size_t i = 0; i < before.size(); ++i) EXPECT_NEAR(cloth_[i], before[i], 1e-5f) << i;
  }
}

TEST_F(SpreadMovesTest, AShortMoveFarFromALongOneIsLeftAlone) {
  Use(41);
  LayOverBall(-0.12f, 0, 0.03f, 0.03f);
  LayOverBall(0.12f, 0, 0.03f, 0.5f * kLeast);
  const std::vector<float> before = cloth_;
  SpreadLongMoves(model_, deep_, listed_, kLeast, moves_.data(), surface());
  EXPECT_NE(cloth_, before);
  for (size_t v = 0; v < sheet_->count(); ++v) {
    if (sheet_->positions[3 * v] > 0.03f) {
      EXPECT_EQ(HeightOf(v), before[3 * v + 1]) << v;
    }
  }
}

// It is out of the skin by that.
TEST_F(SpreadMovesTest, AShortMoveBesideALongOneIsNotTakenBack) {
  Use(31);
  const size_t middle = 15 * 31 + 15, beside = middle + 4;
  Lift(middle, 0.03f);
  Lift(beside, 0.5f * kLeast);
  SpreadLongMoves(model_, deep_, listed_, kLeast, moves_.data(), surface());
  EXPECT_GE(HeightOf(middle), 0.03f);
  EXPECT_GE(HeightOf(beside), 0.5f * kLeast);
  EXPECT_GT(HeightOf(middle + 1), 0.003f);
}

// However it was pushed, and whether it was at all.
TEST_F(SpreadMovesTest, AVertexThatWasHardlyPushedGoesWithTheOthers) {
  const size_t middle = 15 * 31 + 15, beside = middle + 1;
  std::vector<float> first;
  for (const float sideways : {0.0f, 1e-5f, -1e-5f}) {
    Use(31);
    Lift(middle, 0.03f);
    cloth_[3 * beside] += sideways;
    listed_ = ListMove(deep_, listed_, static_cast<uint16_t>(beside), &sheet_->positions[3 * beside], surface());
    SpreadLongMoves(model_, deep_, listed_, kLeast, moves_.data(), surface());
    if (sideways == 0) first = cloth_;
    for (size_t i = 0; i < first.size(); ++i) ASSERT_NEAR(cloth_[i], first[i], 3e-5f) << sideways << " " << i;
  }
}

TEST_F(SpreadMovesTest, NeighboursTakeTheAverage) {
  Use(31);
  const size_t middle = 15 * 31 + 15;
  Lift(middle, 0.01f);
  EXPECT_EQ(SpreadMoves(model_, deep_, listed_, moves_.data(), surface()), 61u);  // four rings of six neighbours
  EXPECT_FLOAT_EQ(HeightOf(middle), 0.01f);
  for (size_t k = 1; k <= 4; ++k) {
    EXPECT_LT(HeightOf(middle + k), HeightOf(middle + k - 1)) << k;
    EXPECT_GT(HeightOf(middle + k), 0) << k;
  }
  EXPECT_EQ(HeightOf(middle + 5), 0);
}

TEST_F(SpreadMovesTest, ClothThatTouchesNothingStays) {
  Use(31);
  const size_t middle = 15 * 31 + 15;
  std::vector<uint8_t> classes(sheet_->count(), 1);
  classes[middle + 1] = 2;
  const std::vector<uint8_t> touched = {1 << 0, 1 << 1};
  model_.body.touch_classes = classes.data();
  model_.body.touched_by = touched.data();
  model_.body.vertex_count = 2;
  Lift(middle, 0.03f);
  SpreadLongMoves(model_, deep_, listed_, kLeast, moves_.data(), surface());
  EXPECT_EQ(HeightOf(middle + 1), 0);
  EXPECT_GT(HeightOf(middle - 1), 0.003f);
}

TEST_F(SpreadMovesTest, AFullListTakesNoMore) {
  Use(60);
  ASSERT_GT(sheet_->count(), kMostDeep);
  for (size_t v = 0; v < sheet_->count(); ++v) Lift(v, 0.02f);
  EXPECT_EQ(listed_, kMostDeep);
  EXPECT_EQ(CountListed(model_, deep_), kMostDeep);
  EXPECT_EQ(SpreadLongMoves(model_, deep_, listed_, kLeast, moves_.data(), surface()), kMostDeep);
  for (size_t v = 0; v < sheet_->count(); ++v) EXPECT_GE(HeightOf(v), 0.02f) << v;
}

TEST_F(SpreadMovesTest, NothingMoved) {
  Use(5);
  EXPECT_EQ(ListMove(deep_, 0, 7, &sheet_->positions[21], surface()), 0u);
  EXPECT_EQ(SpreadLongMoves(model_, deep_, 0, kLeast, moves_.data(), surface()), 0u);
  EXPECT_EQ(SpreadMoves(model_, deep_, 0, moves_.data(), surface()), 0u);
  EXPECT_EQ(cloth_, sheet_->positions);
}

}  // namespace
}  // namespace dcloth::engine
