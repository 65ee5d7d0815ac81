#include "converter/metrics.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <string>

#include "converter/error.h"

namespace dcloth::converter {
namespace {

using Points = Eigen::Matrix<double, Eigen::Dynamic, 3, Eigen::RowMajor>;

Points ToPoints(std::span<const float> positions, size_t vertex_count, const char* which) {
  if (positions.size() != 3 * vertex_count) {
    throw Error({"", "", std::to_string(positions.size() / 3) + std::string(" vertices in the ") + which,
                 std::to_string(vertex_count), "compare sequences and models of one garment"});
  }
  Points points = Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3, Eigen::RowMajor>>(
                      positions.data(), static_cast<Eigen::Index>(vertex_count), 3)
                      .cast<double>();
  if (!points.allFinite()) {
    throw Error({"", "", std::string("NaN or infinity in the ") + which, "finite positions",
                 "check whether training diverged"});
  }
  return points;
}

// Sums of face cross products: area weighting comes for free.
Points VertexNormals(const Points& points, std::span<const uint16_t> triangles) {
  Points normals = Points::Zero(points.rows(), 3);
  for (size_t i = 0; i < triangles.size(); i += 3) {
    const Eigen::RowVector3d a = points.row(triangles[i]);
    const Eigen::RowVector3d normal = (points.row(triangles[i + 1]) - a).cross(points.row(triangles[i + 2]) - a);
    for (size_t corner = 0; corner < 3; ++corner) normals.row(triangles[i + corner]) += normal;
  }
  return normals;
}

double Mean(const std::vector<double>& values) {
  return values.empty() ? 0 : std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double PopulationStd(const std::vector<double>& values, double mean) {
  double sum = 0;
  for (const double value : values) sum += (value - mean) * (value - mean);
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

}  // namespace

double Percentile(std::vector<float>* values, size_t percent) {
  if (values->empty()) return 0;
  const size_t rank = (values->size() * percent + 99) / 100 - 1;
  std::nth_element(values->begin(), values->begin() + static_cast<std::ptrdiff_t>(rank), values->end());
  return static_cast<double>((*values)[rank]);
}

ErrorMeter::ErrorMeter(std::span<const uint16_t> triangles, size_t vertex_count)
    : triangles_(triangles.begin(), triangles.end()), vertex_count_(vertex_count) {
  const bool inside =
      std::all_of(triangles.begin(), triangles.end(), [&](uint16_t vertex) { return vertex < vertex_count; });
  if (vertex_count == 0 || triangles.size() % 3 != 0 || !inside) {
    throw Error({"", "", "triangles that do not fit " + std::to_string(vertex_count) + " vertices",
                 "indices below the vertex count", ""});
  }
}

void ErrorMeter::AddFrame(std::span<const float> predicted, std::span<const float> truth) {
  const Points a = ToPoints(predicted, vertex_count_, "prediction");
  const Points b = ToPoints(truth, vertex_count_, "truth");
  const Eigen::VectorXd distances = 1000 * (a - b).rowwise().norm();  // eq. 19, E_d
  for (const double distance : distances) distances_mm_.push_back(static_cast<float>(distance));
  frame_mm_.push_back(distances.mean());

  const Points normals_a = VertexNormals(a, triangles_), normals_b = VertexNormals(b, triangles_);
  double sum = 0;
  size_t counted = 0;
  for (Eigen::Index i = 0; i < normals_a.rows(); ++i) {
    const Eigen::RowVector3d x = normals_a.row(i), y = normals_b.row(i);
    if (x.squaredNorm() == 0 || y.squaredNorm() == 0) {
      ++skipped_;
      continue;
    }
    // eq. 19, E_n. The angle by atan2: arccos loses half the digits near zero, where good predictions are.
    sum += std::atan2(x.cross(y).norm(), x.dot(y)) * 180 / std::numbers::pi;
    ++counted;
  }
  if (counted != 0) frame_deg_.push_back(sum / static_cast<double>(counted));
}

void ErrorMeter::Add(const ErrorMeter& other) {
  distances_mm_.insert(distances_mm_.end(), other.distances_mm_.begin(), other.distances_mm_.end());
  frame_mm_.insert(frame_mm_.end(), other.frame_mm_.begin(), other.frame_mm_.end());
  frame_deg_.insert(frame_deg_.end(), other.frame_deg_.begin(), other.frame_deg_.end());
  skipped_ += other.skipped_;
}

MeshError ErrorMeter::Result() const {
  MeshError error;
  error.frame_count = frame_mm_.size();
  error.position_mm.mean = Mean(frame_mm_);
  error.position_mm.std = PopulationStd(frame_mm_, error.position_mm.mean);
  std::vector<float> distances = distances_mm_;
  error.position_mm.p50 = Percentile(&distances, 50);
  error.position_mm.p95 = Percentile(&distances, 95);
  error.position_mm.p99 = Percentile(&distances, 99);
  error.position_mm.max = Percentile(&distances, 100);
  error.normal_deg.mean = Mean(frame_deg_);
  error.normal_deg.std = PopulationStd(frame_deg_, error.normal_deg.mean);
  error.normal_deg.skipped = skipped_;
  return error;
}

}  // namespace dcloth::converter
