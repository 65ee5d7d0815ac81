// Affine matrices in double, three rows of four: a frame has a few dozen of them, and precision here is what keeps a
// character sharp far from the origin.
#ifndef DCLOTH_ENGINE_SRC_POSE_AFFINE_H_
#define DCLOTH_ENGINE_SRC_POSE_AFFINE_H_

namespace dcloth::engine {

struct Affine {
  double m[3][4];
};

inline Affine operator*(const Affine& a, const Affine& b) {
  Affine product;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) {
      product.m[r][c] =
          a.m[r][0] * b.m[0][c] + a.m[r][1] * b.m[1][c] + a.m[r][2] * b.m[2][c] + (c == 3 ? a.m[r][3] : 0.0);
    }
  }
  return product;
}

inline void StoreFloats(const Affine& a, float* rows) {
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) rows[4 * r + c] = static_cast<float>(a.m[r][c]);
  }
}

// The angle of a direction without libm, whose last bit differs from system to system.

// atan(t) for |t| <= 0.4375: the polynomial that FreeBSD's libm publishes for this range, within 1e-16.
inline double ArcTangentNearZero(double t) {
  constexpr double kOdd[6] = {3.33333333333329318027e-01, 1.42857142725034663711e-01, 9.09088713343650656196e-02,
                              6.66107313738753120669e-02, 4.97687799461593236017e-02, 1.62858201153657823623e-02};
  constexpr double kEven[5] = {-1.99999999998764832476e-01, -1.11111104054623557880e-01, -7.69187620504482999495e-02,
                               -5.83357013379057348645e-02, -3.65315727442169155270e-02};
  const double z = t * t, w = z * z;
  double odd = kOdd[5], even = kEven[4];
  for (int i = 4; i >= 0; --i) odd = kOdd[i] + w * odd;
  for (int i = 3; i >= 0; --i) even = kEven[i] + w * even;
  return t - t * (z * odd + w * even);
}

// The angle from (1, 0) to (x, y), in [-pi, pi], within 1e-15; 0 where both are 0. Finite numbers.
inline double AngleOf(double y, double x) {
  constexpr double kPi = 3.14159265358979311600, kEighthTangent = 0.41421356237309503;  // tan(pi / 8)
  const double across = y < 0 ? -y : y, along = x < 0 ? -x : x;
  const bool steep = across > along;
  const double more = steep ? across : along, less = steep ? along : across;
  if (!(more > 0)) return 0;
  const double ratio = less / more;
  double angle =
      ratio > kEighthTangent ? kPi / 4 + ArcTangentNearZero((ratio - 1) / (ratio + 1)) : ArcTangentNearZero(ratio);
  if (steep) angle = kPi / 2 - angle;
  if (x < 0) angle = kPi - angle;
  return y < 0 ? -angle : angle;
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_POSE_AFFINE_H_
