#include "tools/report_scene.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace dcloth::tools {

ReportBody BodyOf(const converter::Bundle& bundle) {
  constexpr size_t kInfluences = 4;
  ReportBody body;
  body.positions.assign(bundle.body_positions.data(), bundle.body_positions.data() + bundle.body_positions.size());
  body.faces.assign(bundle.body_faces.data(), bundle.body_faces.data() + bundle.body_faces.size());
  for (const float colour : bundle.body_colours.reshaped<Eigen::RowMajor>()) {
    body.colours.push_back(static_cast<uint8_t>(std::lround(255 * colour)));
  }
  const auto joints = static_cast<size_t>(bundle.body_joint_weights.cols());
  std::vector<uint16_t> order(joints);
  for (auto v = 0 * bundle.body_joint_weights.rows(); v < bundle.body_joint_weights.rows(); ++v) {
    const float* row = bundle.body_joint_weights.data() + v * bundle.body_joint_weights.cols();
    std::iota(order.begin(), order.end(), uint16_t{0});
    const size_t kept = std::min(kInfluences, joints);
    std::partial_sort(order.begin(), order.begin() + static_cast<ptrdiff_t>(kept), order.end(),
                      [&](uint16_t a, uint16_t b) { return row[a] > row[b]; });
    float sum = 0;
    for (size_t k = 0; k < kept; ++k) sum += row[order[k]];
    for (size_t k = 0; k < kInfluences; ++k) {
      body.joints.push_back(k < kept ? order[k] : uint16_t{0});
      body.weights.push_back(k < kept && sum > 0 ? row[order[k]] / sum : 0);
    }
  }
  return body;
}

std::vector<std::array<uint32_t, 2>> SticksOf(const PoseTrack& poses) {
  const size_t joints = poses.joint_count();
  const size_t stride = std::max<size_t>(1, poses.frame_count() / 60);
  const auto distance = [&](size_t frame, size_t a, size_t b) {
    const std::span<const float> m = poses.Frame(frame);
    double sum = 0;
    for (size_t r = 0; r < 3; ++r) sum += std::pow(double{m[16 * a + 4 * r + 3]} - m[16 * b + 4 * r + 3], 2);
    return std::sqrt(sum);
  };
  // A centimetre of stretch counts as much as half a metre of length: rigid first, then short.
  const auto cost = [&](size_t a, size_t b) {
    double low = std::numeric_limits<double>::infinity(), high = 0;
    for (size_t f = 0; f < poses.frame_count(); f += stride) {
      const double d = distance(f, a, b);
      low = std::min(low, d);
      high = std::max(high, d);
    }
    return high + 50 * (high - low);
  };
  // Prim's algorithm.
  std::vector<std::array<uint32_t, 2>> sticks;
  std::vector<double> best(joints, std::numeric_limits<double>::infinity());
  std::vector<uint32_t> parent(joints, 0);
  std::vector<bool> inside(joints, false);
  for (size_t last = 0, step = 1; step < joints; ++step) {
    inside[last] = true;
    size_t next = joints;
    for (size_t j = 0; j < joints; ++j) {
      if (inside[j]) continue;
      const double c = cost(last, j);
      if (c < best[j]) {
        best[j] = c;
        parent[j] = static_cast<uint32_t>(last);
      }
      if (next == joints || best[j] < best[next]) next = j;
    }
    sticks.push_back({parent[next], static_cast<uint32_t>(next)});
    last = next;
  }
  return sticks;
}

void AppendOrigin(std::span<const float> point, ReportSequence* sequence) {
  for (float x : point) {
    sequence->hips.push_back(x);
    sequence->origins.push_back(static_cast<int32_t>(std::lround(x * (1000 / kQuantumMm))));
  }
}

std::span<const int32_t> LastOrigin(const ReportSequence& sequence) { return std::span(sequence.origins).last(3); }

double MeanDistanceMm(std::span<const float> a, std::span<const float> b) {
  double sum = 0;
  for (size_t i = 0; i + 2 < a.size(); i += 3) {
    const double x = double{a[i]} - b[i], y = double{a[i + 1]} - b[i + 1], z = double{a[i + 2]} - b[i + 2];
    sum += std::sqrt(x * x + y * y + z * z);
  }
  return a.empty() ? 0 : 1000 * sum / (static_cast<double>(a.size()) / 3);
}

}  // namespace dcloth::tools
