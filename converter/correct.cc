#include "converter/correct.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace dcloth::converter {
namespace {

constexpr const char* kName = "displacement.basis.weights";
constexpr double kLevels = 127;

// W - stored of one row.
VectorD Remainder(const Matrix& exact, const QuantizedMatrix& stored, uint32_t row) {
  VectorD remainder = exact.row(row).transpose().cast<double>();
  const auto scale = static_cast<double>(stored.row_scales[row]);
  for (size_t c = 0; c < stored.columns; ++c) {
    remainder[static_cast<Eigen::Index>(c)] -=
        scale * static_cast<double>(stored.column_scales[c]) * stored.values[row * stored.columns + c];
  }
  return remainder;
}

// Rows in the order of what rounding takes from them, worst first, and how much that is.
struct Losses {
  std::vector<uint32_t> order;
  std::vector<double> squared;  // by row
};

Losses LossesOf(const Matrix& basis) {
  const QuantizedMatrix stored = QuantizeTwoSided(kName, basis);
  Losses losses;
  for (uint32_t j = 0; j < stored.rows; ++j) losses.squared.push_back(Remainder(basis, stored, j).squaredNorm());
  losses.order.resize(stored.rows);
  std::iota(losses.order.begin(), losses.order.end(), 0u);
  std::stable_sort(losses.order.begin(), losses.order.end(),
                   [&](uint32_t a, uint32_t b) { return losses.squared[a] > losses.squared[b]; });
  return losses;
}

void KeepDirections(Eigen::Index count, ReducedBasis* reduced) {
  reduced->basis.conservativeResize(count, Eigen::NoChange);
  reduced->head.conservativeResize(Eigen::NoChange, count);
  if (reduced->coefficients.weight.size() == 0) return;
  reduced->coefficients.weight.conservativeResize(count, Eigen::NoChange);
  reduced->coefficients.bias.conservativeResize(count);
}

}  // namespace

void TradeForCorrections(ReducedBasis* reduced) {
  const Losses losses = LossesOf(reduced->basis);
  const auto strength = [&](uint32_t row) { return reduced->basis.row(row).cast<double>().squaredNorm(); };
  uint32_t kept = static_cast<uint32_t>(reduced->basis.rows()), corrected = 0;
  while (kept >= corrected + 4) {
    const uint32_t a = losses.order[corrected], b = losses.order[corrected + 1];
    if (a >= kept - 2 || b >= kept - 2) break;
    if (losses.squared[a] + losses.squared[b] <= strength(kept - 1) + strength(kept - 2)) break;
    kept -= 2;
    corrected += 2;
  }
  reduced->corrected.assign(losses.order.begin(), losses.order.begin() + corrected);
  KeepDirections(kept, reduced);
}

void AddCorrections(double squared_error, size_t most, ReducedBasis* reduced) {
  const Losses losses = LossesOf(reduced->basis);
  double left = std::accumulate(losses.squared.begin(), losses.squared.end(), 0.0);
  most = std::min(most, losses.order.size());
  size_t corrected = 0;
  for (; corrected + 2 <= most && left > squared_error; corrected += 2)
    left -= losses.squared[losses.order[corrected]] + losses.squared[losses.order[corrected + 1]];
  reduced->corrected.assign(losses.order.begin(), losses.order.begin() + static_cast<std::ptrdiff_t>(corrected));
}

CorrectedMatrix QuantizeCorrected(const std::string& name, const Matrix& basis, std::span<const uint32_t> corrected) {
  CorrectedMatrix result{QuantizeTwoSided(name, basis), basis};
  QuantizedMatrix& stored = result.stored;
  const auto more = static_cast<Eigen::Index>(corrected.size());
  result.exact.conservativeResize(basis.rows() + more, Eigen::NoChange);
  for (Eigen::Index i = 0; i < more; ++i) {
    const uint32_t row = corrected[static_cast<size_t>(i)];
    const VectorD remainder = Remainder(basis, stored, row);
    // Half a step of the row is 127 steps of its remainder.
    const float scale = stored.row_scales[row] / static_cast<float>(2 * kLevels);
    for (size_t c = 0; c < stored.columns; ++c) {
      const double step = static_cast<double>(scale) * static_cast<double>(stored.column_scales[c]);
      const double level = std::nearbyint(remainder[static_cast<Eigen::Index>(c)] / step);
      stored.values.push_back(static_cast<int8_t>(std::clamp(level, -kLevels, kLevels)));
    }
    stored.row_scales.push_back(scale);
    ++stored.rows;
    result.exact.row(basis.rows() + i) = remainder.transpose().cast<float>();
    result.exact.row(row) -= remainder.transpose().cast<float>();
  }
  return result;
}

Matrix HeadWithCopies(const ReducedBasis& reduced) {
  const Eigen::Index kept = reduced.head.cols();
  Matrix head = reduced.head;
  head.conservativeResize(Eigen::NoChange, kept + static_cast<Eigen::Index>(reduced.corrected.size()));
  for (size_t i = 0; i < reduced.corrected.size(); ++i)
    head.col(kept + static_cast<Eigen::Index>(i)) = reduced.head.col(reduced.corrected[i]);
  return head;
}

LinearWeights CoefficientsWithCopies(const ReducedBasis& reduced) {
  LinearWeights linear = reduced.coefficients;
  const Eigen::Index kept = linear.weight.rows();
  if (kept == 0) return linear;
  const auto more = static_cast<Eigen::Index>(reduced.corrected.size());
  linear.weight.conservativeResize(kept + more, Eigen::NoChange);
  linear.bias.conservativeResize(kept + more);
  for (Eigen::Index i = 0; i < more; ++i) {
    const uint32_t row = reduced.corrected[static_cast<size_t>(i)];
    linear.weight.row(kept + i) = reduced.coefficients.weight.row(row);
    linear.bias[kept + i] = reduced.coefficients.bias[row];
  }
  return linear;
}

}  // namespace dcloth::converter
