// Poses between two frames against rotations made by angle.
#include "engine/src/time/pose_blend.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace dcloth::engine {
namespace {

using Axis = double[3];

// Rodrigues' formula; columns scaled by `lengths`.
Affine Turned(const Axis& axis, double angle, const double (&lengths)[3], const double (&place)[3]) {
  const double c = std::cos(angle), s = std::sin(angle);
  const double cross[3][3] = {{0, -axis[2], axis[1]}, {axis[2], 0, -axis[0]}, {-axis[1], axis[0], 0}};
  Affine m;
  for (int r = 0; r < 3; ++r) {
    for (int k = 0; k < 3; ++k) {
      m.m[r][k] = (c * (r == k) + s * cross[r][k] + (1 - c) * axis[r] * axis[k]) * lengths[k];
    }
    m.m[r][3] = place[r];
  }
  return m;
}

double Difference(const Affine& a, const Affine& b) {
  double largest = 0;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) largest = std::max(largest, std::abs(a.m[r][c] - b.m[r][c]));
  }
  return largest;
}

Affine BlendOne(const Affine& from, const Affine& to, double fraction) {
  Affine out;
  PoseBetween({&from, &from, &to, 0}, fraction, 1, &out);
  return out;
}

// The angle of the normalised straight blend of quaternions, against the even arc.
double ArcError(double angle, double fraction) {
  const double half = angle / 2;
  return std::abs(2 * std::atan2(fraction * std::sin(half), 1 - fraction + fraction * std::cos(half)) -
                  fraction * angle);
}

// Up to half a turn, about any axis, with stretched axes: the same axis, the blended lengths, an angle off by
// what the formula of the straight blend says and rounding.
TEST(PoseBlendTest, TurnsAboutTheSameAxis) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  double worst_arc = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    Axis axis = {normal(random), normal(random), normal(random)};
    const double norm = std::sqrt(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]);
    for (double& x : axis) x /= norm;
    const double start = 3 * normal(random), angle = 3.1 * std::generate_canonical<double, 53>(random);
    const double fraction = std::generate_canonical<double, 53>(random);
    const double lengths[2][3] = {{1, 1.1, 0.9}, {1.2, 0.8, 1}}, places[2][3] = {{1, 2, 3}, {-1, 0, 5}};
    const Affine from = Turned(axis, start, lengths[0], places[0]);
    const Affine to = Turned(axis, start + angle, lengths[1], places[1]);
    double length[3], place[3];
    for (int i = 0; i < 3; ++i) {
      length[i] = lengths[0][i] + fraction * (lengths[1][i] - lengths[0][i]);
      place[i] = places[0][i] + fraction * (places[1][i] - places[0][i]);
    }
    const Affine expected = Turned(axis, start + fraction * angle, length, place);
    const double arc = ArcError(angle, fraction);
    ASSERT_LE(Difference(BlendOne(from, to, fraction), expected), 1.2 * arc + 1e-12) << angle << " " << fraction;
    if (angle < 0.5) worst_arc = std::max(worst_arc, arc);
  }
  EXPECT_LT(worst_arc, 0.002) << "what the comment in pose_blend.cc says";
}

// A motion that speeds up, seen by three frames of unlike length: positions on their parabola, rotations
// where the parabola of tan(angle / 2) has them. Both to rounding; and the true motion is nearer than the
// straight blend by far.
TEST(PoseBlendTest, ThreeFramesFollowTheCurve) {
  const Axis axis = {0.6, 0, 0.8};
  const auto angle = [](double t) { return 0.4 * t + 0.15 * t * t; };
  const auto at = [&](double t) {
    return Turned(axis, 0.3 + angle(t), {1, 1, 2}, {1 + t * t, 2 - 3 * t, 5 * t - 2 * t * t});
  };
  double worst_curve = 0, worst_straight = 0;
  for (const double gap : {0.2, 1.0, 4.0}) {
    const Affine older = at(-gap), before = at(0), now = at(1);
    for (const double f : {0.1, 0.5, 0.8}) {
      Affine found, straight;
      PoseBetween({&older, &before, &now, gap}, f, 1, &found);
      PoseBetween({&older, &before, &now, 0}, f, 1, &straight);
      const double to = std::tan(angle(1) / 2), from = std::tan(angle(-gap) / 2);
      // Lagrange's form of the parabola through (-gap, from), (0, 0), (1, to).
      const double g = from * f * (f - 1) / (gap * (gap + 1)) + to * f * (f + gap) / (1 + gap);
      const Affine truth = at(f);
      const Affine expected =
          Turned(axis, 0.3 + 2 * std::atan(g), {1, 1, 2}, {truth.m[0][3], truth.m[1][3], truth.m[2][3]});
      EXPECT_LT(Difference(found, expected), 1e-13) << gap << " " << f;
      worst_curve = std::max(worst_curve, Difference(found, truth));
      worst_straight = std::max(worst_straight, Difference(straight, truth));
    }
  }
  EXPECT_LT(worst_curve, worst_straight / 5);
}

TEST(PoseBlendTest, EndsAreThePosesThemselves) {
  const Axis axis = {0, 0.6, 0.8};
  const Affine from = Turned(axis, 0.3, {1, 2, 3}, {1, 2, 3}), to = Turned(axis, 2.9, {1, 1, 1}, {0, 0, 0});
  EXPECT_LT(Difference(BlendOne(from, to, 0), from), 1e-14);
  EXPECT_LT(Difference(BlendOne(from, to, 1), to), 1e-14);
}

// Half a turn has two ways and no middle: some rotation comes out, not a collapsed or broken one.
TEST(PoseBlendTest, HalfATurnStaysARotation) {
  const Axis axes[] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.6, 0.8, 0}};
  for (const Axis& axis : axes) {
    const Affine from = Turned(axis, 0, {1, 1, 1}, {0, 0, 0});
    const Affine to = Turned(axis, std::acos(-1.0), {1, 1, 1}, {0, 0, 0});
    const Affine half = BlendOne(from, to, 0.5);
    for (int a = 0; a < 3; ++a) {
      for (int b = 0; b < 3; ++b) {
        double dot = 0;
        for (int r = 0; r < 3; ++r) dot += half.m[r][a] * half.m[r][b];
        EXPECT_NEAR(dot, a == b, 1e-12);
      }
    }
  }
}

TEST(PoseBlendTest, BrokenAxesBlendStraight) {
  const Affine zero = {}, plain = {{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  const Affine mirrored = {{{-1, 0, 0, 4}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
  for (const Affine* broken : {&zero, &mirrored}) {
    const Affine half = BlendOne(*broken, plain, 0.25);
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) EXPECT_DOUBLE_EQ(half.m[r][c], 0.75 * broken->m[r][c] + 0.25 * plain.m[r][c]);
    }
  }
}

}  // namespace
}  // namespace dcloth::engine
