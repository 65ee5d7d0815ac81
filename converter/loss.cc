#include "converter/loss.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "kernels/half.h"

namespace dcloth::converter {
namespace {

// Squared sums over a row without its largest elements.
struct RowSums {
  double signal = 0, noise = 0;
};

// The largest magnitude that is none of a row's outliers; below zero where there are no others.
float LargestOther(const Matrix& exact, Eigen::Index row, std::vector<float>* sizes) {
  const auto columns = static_cast<size_t>(exact.cols());
  const size_t outliers = std::max<size_t>(1, columns / kElementsPerOutlier);
  if (outliers >= columns) return -1;
  sizes->resize(columns);
  Eigen::Map<Eigen::RowVectorXf>(sizes->data(), exact.cols()) = exact.row(row).cwiseAbs();
  const auto other = sizes->begin() + static_cast<std::ptrdiff_t>(outliers);
  std::nth_element(sizes->begin(), other, sizes->end(), std::greater<>());
  return *other;
}

std::optional<RowLoss> WorstRow(const std::vector<RowSums>& rows) {
  constexpr double kSmallRow = 0.01;  // squared, of the median row
  std::vector<double> signals;
  for (const RowSums& row : rows) {
    if (row.signal > 0) signals.push_back(row.signal);
  }
  if (signals.empty()) return std::nullopt;
  const auto median = signals.begin() + static_cast<std::ptrdiff_t>(signals.size() / 2);
  std::nth_element(signals.begin(), median, signals.end());
  std::optional<RowLoss> worst;
  uint32_t low_count = 0;
  for (uint32_t j = 0; j < rows.size(); ++j) {
    if (rows[j].noise == 0 || rows[j].signal < kSmallRow * *median) continue;
    const double snr_db = 10 * std::log10(rows[j].signal / rows[j].noise);
    low_count += snr_db < kLowRowSnrDb ? 1 : 0;
    if (!worst || snr_db < worst->snr_db) worst = RowLoss{j, snr_db};
  }
  if (worst) worst->low_count = low_count;
  return worst;
}

// `stored` gives the value of element (j, c) after storing, `limit` the magnitude from which it is clipped.
TensorLoss Measure(const Matrix& exact, const auto& stored, const auto& limit) {
  TensorLoss loss = ExactLoss({exact.data(), static_cast<size_t>(exact.size())});
  double error = 0, total = 0, worst = 0;
  std::vector<RowSums> rows(static_cast<size_t>(exact.rows()));
  std::vector<float> sizes;
  for (Eigen::Index j = 0; j < exact.rows(); ++j) {
    const float largest_other = LargestOther(exact, j, &sizes);
    for (Eigen::Index c = 0; c < exact.cols(); ++c) {
      const auto row = static_cast<size_t>(j), column = static_cast<size_t>(c);
      const auto value = static_cast<double>(exact(j, c));
      const double kept = stored(row, column), difference = kept - value;
      error += difference * difference;
      total += value * value;
      if (std::abs(exact(j, c)) <= largest_other) {
        rows[row].signal += value * value;
        rows[row].noise += difference * difference;
      }
      worst = std::max(worst, std::abs(difference));
      loss.clipped += std::abs(value) > limit(row, column) ? 1 : 0;
      loss.zeroed += kept == 0 && value != 0 ? 1 : 0;
    }
  }
  const double largest = std::max(std::abs(loss.lowest), std::abs(loss.highest));
  if (error > 0) {
    loss.relative_rms = std::sqrt(error / total);
    loss.relative_max = worst / largest;
    loss.snr_db = 10 * std::log10(total / error);
  }
  loss.worst_row = WorstRow(rows);
  return loss;
}

}  // namespace

TensorLoss ExactLoss(std::span<const float> values) {
  TensorLoss loss;
  if (values.empty()) return loss;
  const auto [lowest, highest] = std::minmax_element(values.begin(), values.end());
  loss.lowest = static_cast<double>(*lowest);
  loss.highest = static_cast<double>(*highest);
  return loss;
}

TensorLoss LossOf(const Matrix& exact, const QuantizedMatrix& stored) {
  const auto step = [&](size_t j, size_t c) {
    return static_cast<double>(stored.row_scales[j]) * static_cast<double>(stored.column_scales[c]);
  };
  // Levels end at 127; what is nearer to 128 is clipped.
  return Measure(
      exact, [&](size_t j, size_t c) { return step(j, c) * stored.values[j * stored.columns + c]; },
      [&](size_t j, size_t c) { return 127.5 * step(j, c); });
}

TensorLoss LossOf(const Matrix& exact, std::span<const uint16_t> halves) {
  const auto columns = static_cast<size_t>(exact.cols());
  // QuantizeHalf refuses what would round past the last half.
  return Measure(
      exact, [&](size_t j, size_t c) { return static_cast<double>(kernels::FloatFromHalf(halves[j * columns + c])); },
      [](size_t, size_t) { return 65520.0; });
}

}  // namespace dcloth::converter
