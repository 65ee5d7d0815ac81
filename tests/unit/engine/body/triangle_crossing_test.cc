// Two triangles that cross, and how far one has to go.
#include "engine/src/body/triangle_crossing.h"

#include <gtest/gtest.h>

#include <limits>

namespace dcloth::engine {
namespace {

Triangle TriangleOf(Vec a, Vec b, Vec c) {
  Triangle triangle = {{a, b, c}, {}};
  triangle.FillNormal();
  return triangle;
}

// Cloth at a height over the plane y = 0, 2 wide.
Triangle ClothAt(double height) { return TriangleOf({-1, height, -1}, {-1, height, 1}, {1, height, 0}); }

bool Crosses(const Triangle& cloth, Triangle skin) {
  Crossing crossing;
  return DoCross(cloth, &skin, &crossing);
}

// Skin with a corner at y = 1 and an edge at y = 0.
const Triangle kTooth = TriangleOf({0, 0, -0.1}, {0, 1, 0}, {0, 0, 0.1});

TEST(TriangleCrossingTest, AToothThroughTheMiddleCrosses) {
  EXPECT_TRUE(Crosses(ClothAt(0.5), kTooth));
  EXPECT_TRUE(Crosses(kTooth, ClothAt(0.5)));
  EXPECT_TRUE(Crosses(ClothAt(0.999), kTooth));
  EXPECT_FALSE(Crosses(ClothAt(1.001), kTooth));
  EXPECT_FALSE(Crosses(ClothAt(-0.001), kTooth));
}

TEST(TriangleCrossingTest, ATriangleBesideDoesNot) {
  Triangle beside = kTooth;
  for (Vec& corner : beside.corners) corner.x += 1.001;
  beside.FillNormal();
  EXPECT_FALSE(Crosses(ClothAt(0.5), beside)) << "its edge passes through the plane, outside the triangle";
  EXPECT_FALSE(Crosses(ClothAt(0), ClothAt(0))) << "in one plane";
}

TEST(TriangleCrossingTest, WhatIsNoNumberDoesNot) {
  Triangle cloth = ClothAt(0.5);
  cloth.corners[1].y = std::numeric_limits<double>::quiet_NaN();
  cloth.FillNormal();
  EXPECT_FALSE(Crosses(cloth, kTooth));
}

double Lift(const Triangle& cloth, Triangle skin, double outward) {
  Crossing crossing;
  if (!DoCross(cloth, &skin, &crossing)) return -1;
  const double length = outward * std::sqrt(Dot(skin.normal, skin.normal));
  return LiftOf(crossing, cloth, (1 / length) * skin.normal, length);
}

// Skin that rises by 45 degrees to a corner at y = 1: the corner is under the cloth before all of the cloth is above
// the skin's plane.
TEST(TriangleCrossingTest, TheNearerWayCounts) {
  const Triangle rising = TriangleOf({-1, 0, -0.1}, {0, 1, 0}, {-1, 0, 0.1});
  const Triangle turned = TriangleOf({-1, 0, 0.1}, {0, 1, 0}, {-1, 0, -0.1});
  const double outward = rising.normal.y > 0 ? 1 : -1;
  const double way = 0.1 * std::sqrt(2.0);  // along the normal, which is 45 degrees from the way up
  EXPECT_NEAR(Lift(ClothAt(0.9), rising, outward), way, 1e-12);
  EXPECT_NEAR(Lift(ClothAt(0.9), turned, -outward), way, 1e-12) << "as often as the order of corners turns";
  const Triangle low = TriangleOf({-0.9, 0.05, -0.01}, {-0.9, 0.05, 0.01}, {-0.5, 0.9, 0});
  EXPECT_NEAR(Lift(low, rising, outward), 0.05 / std::sqrt(2.0), 1e-12) << "two corners under the skin's plane";
}

}  // namespace
}  // namespace dcloth::engine
