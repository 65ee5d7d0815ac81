// Every face that a triangle crosses is among those near it, and few others are.
#include "engine/src/body/near_faces.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>
#include <vector>

#include "engine/src/body/triangle_crossing.h"
#include "tests/unit/engine/loose_faces.h"

namespace dcloth::testing {
namespace {

using engine::Triangle;
using engine::TriangleBatch;

// Triangles of about `size` anywhere in a cube of 1 m.
std::vector<float> Anywhere(size_t count, float size, std::mt19937* random) {
  std::uniform_real_distribution<float> place(0, 1), beside(-size, size);
  std::vector<float> positions;
  for (size_t i = 0; i < count; ++i) {
    const float middle[3] = {place(*random), place(*random), place(*random)};
    for (size_t c = 0; c < 9; ++c) positions.push_back(middle[c % 3] + beside(*random));
  }
  return positions;
}

Triangle TriangleAt(const float* positions) {
  Triangle triangle = {};
  for (size_t k = 0; k < 3; ++k) triangle.corners[k] = engine::VecAt(positions + 3 * k);
  triangle.FillNormal();
  return triangle;
}

struct Cloth {
  explicit Cloth(std::vector<float> at) : positions(std::move(at)) {
    for (size_t v = 0; v < positions.size() / 3; ++v) faces.push_back(static_cast<uint16_t>(v));
  }
  engine::Surface surface() { return {positions.data(), 3 * sizeof(float), nullptr, 0, nullptr, 0}; }

  std::vector<float> positions;
  std::vector<uint16_t> faces;
};

TEST(NearFacesTest, EveryFaceThatCrossesIsFoundOnce) {
  std::mt19937 random(7);
  const std::vector<float> skin = Anywhere(1200, 0.05f, &random);
  const LooseFaces body(skin);
  Cloth cloth(Anywhere(400, 0.08f, &random));
  const engine::NearFaces near(*body.posed().body, body.sites(), body.lists(), LooseFaces::kClearance);
  const engine::Surface surface = cloth.surface();
  size_t crossing = 0, seen = 0;
  for (size_t from = 0; from < 400; from += TriangleBatch::kMost) {
    TriangleBatch batch;
    for (batch.count = 0; batch.count < TriangleBatch::kMost; ++batch.count)
      batch.faces[batch.count] = cloth.faces.data() + 3 * (from + batch.count);
    EXPECT_GT(near.FindGroups(surface, &batch), 0u);
    for (size_t i = 0; i < batch.count; ++i) {
      std::multiset<size_t> found;
      near.Each(surface, batch, i, [&](const uint16_t* corners) { found.insert(corners[0] / 3); });
      seen += found.size();
      const Triangle triangle = TriangleAt(&cloth.positions[9 * (from + i)]);
      for (size_t f = 0; f < 1200; ++f) {
        EXPECT_LE(found.count(f), 1u);
        Triangle face = TriangleAt(&skin[9 * f]);
        engine::Crossing at;
        if (!engine::DoCross(triangle, &face, &at)) continue;
        ++crossing;
        EXPECT_EQ(found.count(f), 1u) << "triangle " << from + i << " crosses face " << f;
      }
    }
  }
  EXPECT_GT(crossing, 100u);
  EXPECT_LT(seen, 400u * 1200u / 20);
}

TEST(NearFacesTest, WhatIsNoNumberIsNearNothing) {
  std::mt19937 random(8);
  const LooseFaces body(Anywhere(100, 0.04f, &random));
  Cloth cloth(std::vector<float>(9, std::numeric_limits<float>::quiet_NaN()));
  const engine::NearFaces near(*body.posed().body, body.sites(), body.lists(), LooseFaces::kClearance);
  TriangleBatch batch;
  batch.faces[0] = cloth.faces.data();
  batch.count = 1;
  near.FindGroups(cloth.surface(), &batch);
  size_t seen = 0;
  near.Each(cloth.surface(), batch, 0, [&](const uint16_t*) { ++seen; });
  EXPECT_EQ(seen, 0u);
}

}  // namespace
}  // namespace dcloth::testing
