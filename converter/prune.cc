#include "converter/prune.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace dcloth::converter {
namespace {

// The most weights worth keeping that any row has.
uint32_t MostWeights(const MatrixD& dense) {
  Eigen::Index most = 1;
  for (Eigen::Index i = 0; i < dense.rows(); ++i)
    most = std::max(most, (dense.row(i).array() > kNegligibleWeight).count());
  return static_cast<uint32_t>(most);
}

}  // namespace

PrunedWeights Prune(const MatrixD& dense, uint32_t influences) {
  const auto columns = static_cast<uint32_t>(dense.cols());
  PrunedWeights pruned;
  pruned.influences = std::min(influences, MostWeights(dense));
  std::vector<uint32_t> order(columns);
  for (Eigen::Index i = 0; i < dense.rows(); ++i) {
    std::iota(order.begin(), order.end(), 0u);
    std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return dense(i, a) > dense(i, b); });
    double kept = 0;
    for (uint32_t k = 0; k < pruned.influences; ++k) kept += dense(i, order[k]);
    for (uint32_t k = 0; k < pruned.influences; ++k) {
      const auto weight = static_cast<float>(dense(i, order[k]) / kept);
      pruned.columns.push_back(weight > 0 ? order[k] : order[0]);
      pruned.weights.push_back(weight);
    }
  }
  return pruned;
}

PruneReport MeasurePruning(const MatrixD& dense, const PrunedWeights& pruned, const Matrix& points,
                           const MatrixD& pivots, std::span<const std::vector<Eigen::Matrix4d>> poses) {
  PruneReport report;
  report.influences = pruned.influences;
  const Eigen::Index n = dense.rows(), columns = dense.cols();
  double error_sum = 0;
  for (Eigen::Index i = 0; i < n; ++i) {
    VectorD sparse = VectorD::Zero(columns);
    std::vector<bool> kept(static_cast<size_t>(columns), false);
    for (uint32_t k = 0; k < pruned.influences; ++k) {
      const size_t at = static_cast<size_t>(i) * pruned.influences + k;
      sparse[pruned.columns[at]] += static_cast<double>(pruned.weights[at]);
      kept[pruned.columns[at]] = true;
    }
    const Eigen::RowVector3d point = points.row(i).cast<double>();
    double removed = 0, spread = 0;
    for (Eigen::Index j = 0; j < columns; ++j) {
      if (kept[static_cast<size_t>(j)] || dense(i, j) == 0) continue;
      removed += dense(i, j);
      // An image of the point lies |point - pivot| from the posed pivot, whatever the rotation.
      for (Eigen::Index other = 0; other < columns; ++other) {
        if (!kept[static_cast<size_t>(other)]) continue;
        spread = std::max(spread, (point - pivots.row(j)).norm() + (pivots.row(j) - pivots.row(other)).norm() +
                                      (pivots.row(other) - point).norm());
      }
    }
    report.removed_mean += removed / static_cast<double>(n);
    report.removed_worst = std::max(report.removed_worst, removed);
    // The kept images' mean and the removed ones' mean differ by at most `spread`, and pruning swaps `removed` of one
    // for the other.
    report.bound_worst_mm = std::max(report.bound_worst_mm, 1000 * removed * spread);

    const VectorD difference = dense.row(i).transpose() - sparse;
    const Eigen::Vector4d homogeneous(point[0], point[1], point[2], 1);
    for (const std::vector<Eigen::Matrix4d>& pose : poses) {
      Eigen::Vector3d moved = Eigen::Vector3d::Zero();
      for (Eigen::Index j = 0; j < columns; ++j) {
        if (difference[j] != 0) moved += difference[j] * (pose[static_cast<size_t>(j)] * homogeneous).head<3>();
      }
      const double error_mm = 1000 * moved.norm();
      error_sum += error_mm;
      report.worst_mm = std::max(report.worst_mm, error_mm);
    }
  }
  report.measured = !poses.empty();
  if (report.measured) report.mean_mm = error_sum / (static_cast<double>(n) * static_cast<double>(poses.size()));
  return report;
}

}  // namespace dcloth::converter
