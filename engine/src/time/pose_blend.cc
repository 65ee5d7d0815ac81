#include "engine/src/time/pose_blend.h"

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

// The rotation `fraction` of the way from none to q, which need not be of length 1 where that is 1.
// Normalising the straight blend with none is off the even arc by less than 0.002 rad for half a radian
// between two frames, which is fast, and never degenerates since q.w >= 0.
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

// b a^-1.
Quaternion TurnBetween(const Axes& a, const Axes& b) {
  double turn[3][3];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      turn[r][c] = b.rotation[r][0] * a.rotation[c][0] + b.rotation[r][1] * a.rotation[c][1] +
                   b.rotation[r][2] * a.rotation[c][2];
    }
  }
  return ToQuaternion(turn);
}

// The parabola y with y(0) = 0, y(1) = now, y(-gap) = older is fraction now + bend (older + gap now).
double BendOf(double gap, double fraction) { return (fraction * fraction - fraction) / (gap * gap + gap); }

// Rotations as tan(angle / 2) times the axis, where a parabola through three of them is one of vectors. Only
// for turns below 120 degrees: a frame that turns further says nothing about the one before it.
bool CurvedRotation(const Quaternion& now, const Quaternion& older, double gap, double fraction, Quaternion* q) {
  constexpr double kSmallestCosine = 0.5;  // of half the angle
  if (gap == 0 || now.w < kSmallestCosine || older.w < kSmallestCosine) return false;
  const double bend = BendOf(gap, fraction);
  q->w = 1;
  for (int i = 0; i < 3; ++i) {
    const double to = now.v[i] / now.w, from = older.v[i] / older.w;
    q->v[i] = fraction * to + bend * (from + gap * to);
  }
  return true;
}

Affine Between(const Affine& older, const Affine& before, const Affine& now, double gap, double fraction) {
  Affine out = Straight(before, now, fraction);
  for (int r = 0; r < 3 && gap != 0; ++r) {
    const double start = before.m[r][3];
    out.m[r][3] += BendOf(gap, fraction) * (older.m[r][3] - start + gap * (now.m[r][3] - start));
  }
  Axes o, b, n;
  if (!SplitAxes(before, &b) || !SplitAxes(now, &n)) return out;
  const Quaternion turn = TurnBetween(b, n);
  double turned[3][3];
  Quaternion curved;
  if (SplitAxes(older, &o) && CurvedRotation(turn, TurnBetween(b, o), gap, fraction, &curved)) {
    PartialRotation(curved, 1, turned);
  } else {
    PartialRotation(turn, fraction, turned);
  }
  for (int c = 0; c < 3; ++c) {
    const double length = b.length[c] + fraction * (n.length[c] - b.length[c]);
    for (int r = 0; r < 3; ++r) {
      out.m[r][c] = length * (turned[r][0] * b.rotation[0][c] + turned[r][1] * b.rotation[1][c] +
                              turned[r][2] * b.rotation[2][c]);
    }
  }
  return out;
}

}  // namespace

void PoseBetween(const PoseHistory& history, double fraction, size_t joint_count, Affine* out) {
  for (size_t j = 0; j < joint_count; ++j)
    out[j] = Between(history.older[j], history.before[j], history.now[j], history.older_gap, fraction);
}

}  // namespace dcloth::engine
