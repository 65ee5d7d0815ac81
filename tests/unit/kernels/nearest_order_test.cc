// Vertices by place: every one once, runs of them close together, whatever their positions.
#include "kernels/nearest/nearest_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <random>
#include <vector>

namespace dcloth::kernels {
namespace {

// A grid of `rows` by `columns`, a unit apart, its vertices numbered at random.
std::vector<float> Grid(size_t rows, size_t columns) {
  std::vector<float> positions(3 * rows * columns, 0.0f);
  std::vector<size_t> place(rows * columns);
  for (size_t i = 0; i < place.size(); ++i) place[i] = i;
  std::mt19937 random(3);
  for (size_t i = place.size() - 1; i > 0; --i) std::swap(place[i], place[random() % (i + 1)]);
  for (size_t i = 0; i < place.size(); ++i) {
    positions[3 * i] = static_cast<float>(place[i] % columns) - 5.0f;
    positions[3 * i + 2] = static_cast<float>(place[i] / columns);
  }
  return positions;
}

std::vector<uint16_t> Ordered(const std::vector<float>& positions) {
  std::vector<uint16_t> order(positions.size() / 3);
  std::iota(order.begin(), order.end(), uint16_t{0});
  OrderByPlace(positions.data(), order.data(), order.size());
  std::vector<uint16_t> sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (size_t i = 0; i < sorted.size(); ++i) EXPECT_EQ(sorted[i], i);
  return order;
}

// Longest side of the box around each run of `length`.
float LongestSide(const std::vector<float>& positions, const std::vector<uint16_t>& order, size_t length) {
  float longest = 0;
  for (size_t begin = 0; begin < order.size(); begin += length) {
    for (size_t c = 0; c < 3; ++c) {
      float low = 1e9f, high = -1e9f;
      for (size_t i = begin; i < std::min(begin + length, order.size()); ++i) {
        low = std::min(low, positions[3 * order[i] + c]);
        high = std::max(high, positions[3 * order[i] + c]);
      }
      longest = std::max(longest, high - low);
    }
  }
  return longest;
}

// 64 by 64 vertices halve into squares and their halves without a rest.
TEST(PatchOrderTest, RunsOfAGridAreSquares) {
  const std::vector<float> positions = Grid(64, 64);
  const std::vector<uint16_t> order = Ordered(positions);
  EXPECT_EQ(LongestSide(positions, order, kNearestPatch), 7.0f);
  EXPECT_EQ(LongestSide(positions, order, 16), 3.0f);
  EXPECT_EQ(LongestSide(positions, order, 4), 1.0f);
}

// Within a constant of the square that holds as many: a half may be off by a patch, and halves of halves.
TEST(PatchOrderTest, RunsOfOtherGridsAreCompact) {
  for (const size_t rows : {3, 17, 50, 83}) {
    const std::vector<float> positions = Grid(rows, 96);
    const std::vector<uint16_t> order = Ordered(positions);
    const float even = std::sqrt(static_cast<float>(kNearestPatch));
    const float thin = static_cast<float>(kNearestPatch) / static_cast<float>(std::min<size_t>(rows, 8));
    EXPECT_LE(LongestSide(positions, order, kNearestPatch), 2 * std::max(even, thin)) << rows;
  }
}

TEST(PatchOrderTest, EveryCountAndAnyFloats) {
  std::mt19937 random(4);
  const float odd[] = {0.0f, -0.0f, 1e30f, -1e30f, 1e-40f, NAN, -NAN, INFINITY, -INFINITY, 0.5f};
  for (size_t count = 0; count <= 300; ++count) {
    std::vector<float> positions(3 * count);
    for (float& x : positions) x = odd[random() % 10];
    Ordered(positions);
    Ordered(std::vector<float>(3 * count, 1.0f));
  }
  Ordered(std::vector<float>(size_t{3} * 65536, 1.0f));
}

// Points of a class follow each other; sites of a mask do, in whole groups.
TEST(NearestOrderTest, ClassesAndMasks) {
  const std::vector<float> positions = Grid(20, 20);
  std::mt19937 random(5);
  std::vector<uint8_t> classes(400), masks(400);
  for (uint8_t& c : classes) c = static_cast<uint8_t>(random() % 3);
  for (uint8_t& mask : masks) mask = static_cast<uint8_t>(random() % 4);
  std::vector<uint16_t> order(400);
  OrderPoints(positions.data(), classes.data(), 400, order.data());
  for (size_t i = 1; i < 400; ++i) EXPECT_LE(classes[order[i - 1]], classes[order[i]]);
  std::sort(order.begin(), order.end());
  for (size_t i = 0; i < 400; ++i) EXPECT_EQ(order[i], i);
  std::vector<uint16_t> sites(kNearestGroup * CountSiteGroups(masks.data(), 400), 0xFFFF);
  OrderSites(positions.data(), masks.data(), 400, sites.data());
  std::vector<size_t> seen(400);
  for (size_t i = 0; i < sites.size(); ++i) {
    ASSERT_LT(sites[i], 400u);
    EXPECT_EQ(masks[sites[i]], masks[sites[i / kNearestGroup * kNearestGroup]]) << i;
    ++seen[sites[i]];
  }
  for (size_t i = 0; i < 400; ++i) EXPECT_EQ(seen[i] != 0, masks[i] != 0) << i;
}

}  // namespace
}  // namespace dcloth::kernels
