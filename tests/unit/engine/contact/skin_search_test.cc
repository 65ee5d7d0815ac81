// The closest point of the skin, against all faces of a body in double.
#include "engine/src/contact/skin_search.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/unit/engine/test_body.h"

namespace dcloth::testing {
namespace {

TEST(SkinSearch, FindsTheClosestPointFromAVertexNearby) {
  TestModel model = BuildModel({});
  const EggBody egg = AddBody(&model);
  const size_t b = egg.positions.size() / 3;
  std::vector<uint32_t> starts(b + 1), ends;
  for (const uint16_t corner : egg.faces) ++starts[corner + size_t{1}];
  for (size_t v = 0; v < b; ++v) starts[v + 1] += starts[v];
  ends.assign(starts.begin(), starts.end() - 1);
  std::vector<uint16_t> columns(egg.faces.size());
  for (size_t i = 0; i < egg.faces.size(); ++i) columns[ends[egg.faces[i]]++] = static_cast<uint16_t>(i / 3);
  std::vector<float> normals(3 * b);
  for (size_t t = 0; t < egg.faces.size(); t += 3) {
    const auto at = [&](size_t k) { return engine::VecfAt(&egg.positions[size_t{3} * egg.faces[t + k]]); };
    const engine::Vecf n = Cross(at(1) - at(0), at(2) - at(0));
    for (size_t k = 0; k < 3; ++k) {
      float* sum = &normals[size_t{3} * egg.faces[t + k]];
      engine::Store(engine::VecfAt(sum) + n, sum);
    }
  }
  for (size_t v = 0; v < b; ++v) {
    const engine::Vecf n = engine::VecfAt(&normals[3 * v]);
    engine::Store((1 / std::sqrt(Dot(n, n))) * n, &normals[3 * v]);
  }
  format::BodyView body = {};
  body.faces = egg.faces.data();
  body.row_starts = starts.data();
  body.columns = columns.data();
  body.vertex_count = static_cast<uint32_t>(b);
  const engine::PosedSkin skin = {&body, egg.positions.data(), normals.data(), 0};
  std::vector<Point> posed(b);
  for (size_t i = 0; i < 3 * b; ++i) posed[i / 3][i % 3] = static_cast<double>(egg.positions[i]);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> beside(-0.02f, 0.02f);
  int under = 0;
  for (size_t trial = 0; trial < 2000; ++trial) {
    const size_t v = trial % b;
    const float* at = &egg.positions[3 * v];
    const engine::Vecf p = {at[0] + beside(random), at[1] + beside(random), at[2] + beside(random)};
    // A face around the vertex, from whose corners the walk starts.
    const uint16_t* face = &egg.faces[size_t{3} * columns[starts[v]]];
    const engine::ClosestSkin closest = engine::FindClosestSkin(skin, face[0], face[trial % 3], p);
    ASSERT_TRUE(closest.found);
    EXPECT_FALSE(closest.on_rim);
    const double expected =
        SignedDistance(egg, posed, {static_cast<double>(p.x), static_cast<double>(p.y), static_cast<double>(p.z)});
    ASSERT_NEAR(static_cast<double>(closest.height), expected, 5e-4) << trial;
    under += expected < 0 ? 1 : 0;
  }
  EXPECT_GT(under, 500);
}

}  // namespace
}  // namespace dcloth::testing
