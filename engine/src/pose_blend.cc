#include "engine/src/pose_blend.h"

#include <cmath>

namespace dcloth::engine {
namespace {

struct Axes {
  double rotation[3][3];
  double length[3];  // of the columns
};

// False where the columns are no right-handed frame: shear within a few degrees still passes as rotation.
bool SplitAxes(const Affine& matrix, Axes* axes) {
  constexpr double kShortest = 1e-12, kSmallestDeterminant = 0.9;
  for (int c = 0; c < 3; ++c) {
    const double x = matrix.m[0][c], y = matrix.m[1][c], z = matrix.m[2][c];
    axes->length[c] = std::sqrt(x * x + y * y + z * z);
    if (!(axes->length[c] > kShortest)) return false;
    for (int r = 0; r < 3; ++r) axes->rotation[r][c] = matrix.m[r][c] / axes->length[c];
  }
  const auto& m = axes->rotation;
  const double determinant = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                             m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                             m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
  return determinant > kSmallestDeterminant;
}

struct Quaternion {
  double w, v[3];
};

// Of a rotation; Shepperd's method, which divides by the largest component. w >= 0.
Quaternion ToQuaternion(const double (&m)[3][3]) {
  const double trace = m[0][0] + m[1][1] + m[2][2];
  Quaternion q;
  if (trace > 0) {
    q.w = std::sqrt(trace + 1) / 2;
    for (int i = 0; i < 3; ++i) q.v[i] = (m[(i + 2) % 3][(i + 1) % 3] - m[(i + 1) % 3][(i + 2) % 3]) / (4 * q.w);
    return q;
  }
  const int i = m[0][0] >= m[1][1] ? (m[0][0] >= m[2][2] ? 0 : 2) : (m[1][1] >= m[2][2] ? 1 : 2);
  const int j = (i + 1) % 3, k = (i + 2) % 3;
  const double square = 1 + m[i][i] - m[j][j] - m[k][k];  // at least 1 here
  q.v[i] = std::sqrt(square) / 2;
  q.w = (m[k][j] - m[j][k]) / (4 * q.v[i]);
  q.v[j] = (m[i][j] + m[j][i]) / (4 * q.v[i]);
  q.v[k] = (m[i][k] + m[k][i]) / (4 * q.v[i]);
  if (q.w < 0) {
    q.w = -q.w;
    for (double& x : q.v) x = -x;
  }
  return q;
}

// The rotation `fraction` of the way from none to q. Normalising the straight blend with none is off the even arc by
// less than 0.002 rad for half a radian between two frames, which is fast, and never degenerates since q.w >= 0.
void PartialRotation(const Quaternion& q, double fraction, double (&m)[3][3]) {
  double w = 1 - fraction + fraction * q.w, x = fraction * q.v[0], y = fraction * q.v[1], z = fraction * q.v[2];
  const double scale = 1 / std::sqrt(w * w + x * x + y * y + z * z);
  w *= scale, x *= scale, y *= scale, z *= scale;
  const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                             {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                             {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) m[r][c] = rows[r][c];
  }
}

Affine Straight(const Affine& from, const Affine& to, double fraction) {
  Affine out;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) out.m[r][c] = from.m[r][c] + fraction * (to.m[r][c] - from.m[r][c]);
  }
  return out;
}

Affine Blend(const Affine& from, const Affine& to, double fraction) {
  Affine out = Straight(from, to, fraction);
  Axes a, b;
  if (!SplitAxes(from, &a) || !SplitAxes(to, &b)) return out;
  double turn[3][3], part[3][3];  // b a^-1 and the part of it
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      turn[r][c] = b.rotation[r][0] * a.rotation[c][0] + b.rotation[r][1] * a.rotation[c][1] +
                   b.rotation[r][2] * a.rotation[c][2];
    }
  }
  PartialRotation(ToQuaternion(turn), fraction, part);
  for (int c = 0; c < 3; ++c) {
    const double length = a.length[c] + fraction * (b.length[c] - a.length[c]);
    for (int r = 0; r < 3; ++r) {
      out.m[r][c] = length * (part[r][0] * a.rotation[0][c] + part[r][1] * a.rotation[1][c] +
                              part[r][2] * a.rotation[2][c]);
    }
  }
  return out;
}

}  // namespace

void BlendPoses(const Affine* from, const Affine* to, double fraction, size_t joint_count, Affine* out) {
  for (size_t j = 0; j < joint_count; ++j) out[j] = Blend(from[j], to[j], fraction);
}

}  // namespace dcloth::engine
