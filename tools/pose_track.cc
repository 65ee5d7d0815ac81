#include "tools/pose_track.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

#include "converter/error.h"

namespace dcloth::tools {
namespace {

// Times closer than this part of a frame are the same: rounding of f / rate, far below any step that can be seen.
constexpr double kSameTime = 1e-6;

using Quaternion = std::array<double, 4>;  // x, y, z, w

struct Parts {
  Quaternion rotation;
  std::array<double, 3> scale;  // all negative for a mirroring matrix
};

// Shepperd's method: divides by the largest of the four components. r is [3, 3], orthonormal.
Quaternion ToQuaternion(const double (&r)[3][3]) {
  const double trace = r[0][0] + r[1][1] + r[2][2];
  if (trace > 0) {
    const double s = 2 * std::sqrt(trace + 1);
    return {(r[2][1] - r[1][2]) / s, (r[0][2] - r[2][0]) / s, (r[1][0] - r[0][1]) / s, s / 4};
  }
  const int i = r[1][1] > r[0][0] ? (r[2][2] > r[1][1] ? 2 : 1) : (r[2][2] > r[0][0] ? 2 : 0);
  const int j = (i + 1) % 3, k = (i + 2) % 3;
  const double s = 2 * std::sqrt(std::max(0.0, 1 + r[i][i] - r[j][j] - r[k][k]));
  Quaternion q;
  q[i] = s / 4;
  q[j] = (r[j][i] + r[i][j]) / s;
  q[k] = (r[k][i] + r[i][k]) / s;
  q[3] = (r[k][j] - r[j][k]) / s;
  return q;
}

Parts Decompose(const float* m) {
  const auto at = [m](int row, int column) { return static_cast<double>(m[4 * row + column]); };
  const double determinant = at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
                             at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
                             at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
  const double sign = determinant < 0 ? -1 : 1;
  Parts parts;
  double rotation[3][3];
  for (int c = 0; c < 3; ++c) {
    const double length = std::sqrt(at(0, c) * at(0, c) + at(1, c) * at(1, c) + at(2, c) * at(2, c));
    parts.scale[c] = sign * length;
    for (int r = 0; r < 3; ++r) rotation[r][c] = length > 0 ? at(r, c) / parts.scale[c] : (r == c);
  }
  parts.rotation = ToQuaternion(rotation);
  return parts;
}

// Shoemake 1985; straight-line blending where the angle is too small to divide by its sine.
Quaternion Slerp(const Quaternion& a, Quaternion b, double t) {
  double cosine = 0;
  for (int i = 0; i < 4; ++i) cosine += a[i] * b[i];
  if (cosine < 0) {
    cosine = -cosine;
    for (double& x : b) x = -x;
  }
  double wa = 1 - t, wb = t;
  if (cosine < 0.9999) {
    const double angle = std::acos(cosine);
    wa = std::sin((1 - t) * angle) / std::sin(angle);
    wb = std::sin(t * angle) / std::sin(angle);
  }
  Quaternion q;
  double norm = 0;
  for (int i = 0; i < 4; ++i) {
    q[i] = wa * a[i] + wb * b[i];
    norm += q[i] * q[i];
  }
  for (double& x : q) x /= std::sqrt(norm);
  return q;
}

void Interpolate(const float* a, const float* b, double t, float* out) {
  const Parts pa = Decompose(a), pb = Decompose(b);
  const auto [x, y, z, w] = Slerp(pa.rotation, pb.rotation, t);
  const double rotation[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
                                 {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
                                 {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)}};
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) {
      out[4 * r + c] = static_cast<float>(rotation[r][c] * ((1 - t) * pa.scale[c] + t * pb.scale[c]));
    }
    out[4 * r + 3] = static_cast<float>((1 - t) * a[4 * r + 3] + t * b[4 * r + 3]);
  }
  out[12] = out[13] = out[14] = 0;
  out[15] = 1;
}

}  // namespace

PoseTrack::PoseTrack(const converter::Sequence& sequence, std::span<const std::string> joint_names)
    : frame_count_(sequence.frame_count), joint_count_(joint_names.size()), fps_(sequence.fps), wind_(sequence.wind) {
  const std::vector<uint32_t> map = converter::MapJoints(sequence, joint_names);
  matrices_.resize(frame_count_ * joint_count_ * 16);
  for (size_t f = 0; f < frame_count_; ++f) {
    converter::GatherPose(sequence, f, map, std::span(matrices_).subspan(f * joint_count_ * 16, joint_count_ * 16));
  }
}

std::span<const float> PoseTrack::Frame(size_t frame) const {
  return std::span(matrices_).subspan(frame * joint_count_ * 16, joint_count_ * 16);
}

std::array<float, 3> PoseTrack::WindAt(double seconds) const {
  if (wind_.empty()) return {};
  const double position = std::clamp(seconds * fps_, 0.0, static_cast<double>(frame_count_ - 1));
  const double nearest = std::round(position);
  const bool on_frame = std::abs(position - nearest) < kSameTime;
  const auto before = static_cast<size_t>(on_frame ? nearest : position);
  const double t = on_frame ? 0 : position - static_cast<double>(before);
  std::array<float, 3> wind = {};
  for (size_t i = 0; i < 3; ++i) {
    const float a = wind_[3 * before + i], b = on_frame ? a : wind_[3 * before + 3 + i];
    wind[i] = static_cast<float>((1 - t) * a + t * b);
  }
  return wind;
}

void PoseTrack::At(double seconds, std::span<float> matrices) const {
  const double position = std::clamp(seconds * fps_, 0.0, static_cast<double>(frame_count_ - 1));
  const double nearest = std::round(position);
  if (std::abs(position - nearest) < kSameTime) {
    std::ranges::copy(Frame(static_cast<size_t>(nearest)), matrices.begin());
    return;
  }
  const auto before = static_cast<size_t>(position);
  const std::span<const float> a = Frame(before), b = Frame(before + 1);
  for (size_t j = 0; j < joint_count_; ++j) {
    Interpolate(&a[16 * j], &b[16 * j], position - static_cast<double>(before), &matrices[16 * j]);
  }
}

size_t FrameCount(const PoseTrack& poses, double frame_rate, const std::filesystem::path& source) {
  constexpr double kMostFrames = 1 << 24;  // 77 hours at 60 Hz
  const double count = std::floor(poses.duration_seconds() * frame_rate + kSameTime) + 1;
  if (count <= kMostFrames) return static_cast<size_t>(count);
  char found[128];
  std::snprintf(found, sizeof(found), "fps %g, which makes %g s of %zu poses and %g frames at %g Hz", poses.fps(),
                poses.duration_seconds(), poses.frame_count(), count, frame_rate);
  throw converter::Error({.path = source,
                          .tensor = {},
                          .found = found,
                          .expected = "at most 2^24 frames",
                          .mend = "write the sequence's frame rate into it, or lower --fps"});
}

}  // namespace dcloth::tools
