#include "converter/loss.h"

#include <algorithm>
#include <cmath>

#include "kernels/half.h"

namespace dcloth::converter {
namespace {

// `stored` gives the value of element (j, c) after storing, `limit` the magnitude from which it is clipped.
TensorLoss Measure(const Matrix& exact, const auto& stored, const auto& limit) {
  TensorLoss loss = ExactLoss({exact.data(), static_cast<size_t>(exact.size())});
  double error = 0, total = 0, worst = 0;
  for (Eigen::Index j = 0; j < exact.rows(); ++j) {
    for (Eigen::Index c = 0; c < exact.cols(); ++c) {
      const auto row = static_cast<size_t>(j), column = static_cast<size_t>(c);
      const auto value = static_cast<double>(exact(j, c));
      const double kept = stored(row, column), difference = kept - value;
      error += difference * difference;
      total += value * value;
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
