#include "converter/quantize.h"

#include <algorithm>
#include <cmath>

#include "converter/error.h"
#include "kernels/half.h"

namespace dcloth::converter {
namespace {

constexpr double kMaxLevel = 127;
// Keeps every scale and its product with 127 inside float range and above subnormals.
constexpr double kLargest = 1e30, kSmallest = 1e-30;

// The smallest float not below `value`, so that 127 steps still reach the largest weight.
float RoundUp(double value) {
  const auto nearest = static_cast<float>(value);
  return static_cast<double>(nearest) < value ? std::nextafter(nearest, INFINITY) : nearest;
}

void Check(const std::string& name, const Matrix& weights) {
  if (weights.size() == 0) throw Error({"", name, "an empty matrix", "at least one weight", ""});
  const double largest = static_cast<double>(weights.cwiseAbs().maxCoeff());
  if (!(largest <= kLargest)) {
    throw Error(
        {"", name, "the weight " + NumberText(largest), "magnitudes up to 1e30", "check whether training diverged"});
  }
}

// Tight column scales for given row scales, then values and error. Zero columns get scale 1.
QuantizedMatrix Finish(const Matrix& weights, const VectorD& row_scales, std::span<const double> row_weights) {
  QuantizedMatrix result;
  result.rows = static_cast<size_t>(weights.rows());
  result.columns = static_cast<size_t>(weights.cols());
  for (const double scale : row_scales) result.row_scales.push_back(static_cast<float>(scale));
  VectorD column_max = VectorD::Zero(weights.cols());
  for (Eigen::Index j = 0; j < weights.rows(); ++j) {
    const auto scale = static_cast<double>(result.row_scales[static_cast<size_t>(j)]);
    for (Eigen::Index c = 0; c < weights.cols(); ++c) {
      column_max[c] = std::max(column_max[c], std::abs(static_cast<double>(weights(j, c))) / scale);
    }
  }
  for (const double largest : column_max) {
    result.column_scales.push_back(largest > 0 ? RoundUp(std::max(largest / kMaxLevel, kSmallest)) : 1.0f);
  }
  result.values.resize(result.rows * result.columns);
  for (size_t j = 0; j < result.rows; ++j) {
    double row_error = 0;
    for (size_t c = 0; c < result.columns; ++c) {
      const double weight = static_cast<double>(weights(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(c)));
      const double step = static_cast<double>(result.row_scales[j]) * static_cast<double>(result.column_scales[c]);
      const double level = std::clamp(std::nearbyint(weight / step), -kMaxLevel, kMaxLevel);
      result.values[j * result.columns + c] = static_cast<int8_t>(level);
      row_error += (weight - step * level) * (weight - step * level);
    }
    result.squared_error += (row_weights.empty() ? 1.0 : row_weights[j]) * row_error;
  }
  return result;
}

// Largest 1, none so small that s_j x_j could leave float range; zero rows take 1 (their values are zero anyway).
void NormaliseScales(VectorD* scales) {
  const double largest = scales->maxCoeff();
  for (double& scale : *scales) scale = scale > 0 ? std::max(scale / largest, 1e-6) : 1.0;
}

// Alternating equilibration: with t tight for s, no s_j needs to be above max_c |W_jc| / (127 t_c). Each sweep lowers
// scales or leaves them, so the rounding error's bound, sum_j w_j s_j^2 sum_c t_c^2 / 12, never grows.
void Equilibrate(const Matrix& weights, VectorD* row_scales) {
  constexpr int kSweeps = 2;  // the first reaches a fixed point but for the normalisation's floor
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    Eigen::RowVectorXd column = Eigen::RowVectorXd::Zero(weights.cols());
    for (Eigen::Index j = 0; j < weights.rows(); ++j) {
      column = column.cwiseMax(weights.row(j).cast<double>().cwiseAbs() * (1 / (*row_scales)[j]));
    }
    const Eigen::RowVectorXd reciprocal = (column.array() > 0).select(column.cwiseInverse(), 0.0);
    for (Eigen::Index j = 0; j < weights.rows(); ++j) {
      (*row_scales)[j] = weights.row(j).cast<double>().cwiseAbs().cwiseProduct(reciprocal).maxCoeff();
    }
    NormaliseScales(row_scales);
  }
}

}  // namespace

QuantizedMatrix QuantizePerColumn(const std::string& name, const Matrix& weights, std::span<const double> row_weights) {
  Check(name, weights);
  return Finish(weights, VectorD::Ones(weights.rows()), row_weights);
}

QuantizedMatrix QuantizeTwoSided(const std::string& name, const Matrix& weights, std::span<const double> row_weights) {
  QuantizedMatrix best = QuantizePerColumn(name, weights, row_weights);
  const VectorD row_max = weights.cwiseAbs().rowwise().maxCoeff().cast<double>();
  VectorD row_rms(weights.rows());
  for (Eigen::Index j = 0; j < weights.rows(); ++j) {
    row_rms[j] = std::sqrt(weights.row(j).cast<double>().squaredNorm() / static_cast<double>(weights.cols()));
  }
  // A power below 1 leaves some of a row's size to the columns; which is best depends on where the large weights sit.
  for (const VectorD& size : {row_rms, row_max}) {
    for (const double power : {0.5, 0.75, 1.0}) {
      VectorD scales = size.array().pow(power);
      NormaliseScales(&scales);
      Equilibrate(weights, &scales);
      QuantizedMatrix candidate = Finish(weights, scales, row_weights);
      if (candidate.squared_error < best.squared_error) best = std::move(candidate);
    }
  }
  return best;
}

std::vector<uint16_t> QuantizeHalf(const std::string& name, const Matrix& weights) {
  std::vector<uint16_t> halves;
  halves.reserve(static_cast<size_t>(weights.size()));
  for (Eigen::Index j = 0; j < weights.rows(); ++j) {
    for (Eigen::Index c = 0; c < weights.cols(); ++c) {
      halves.push_back(kernels::HalfFromFloat(weights(j, c)));
      if ((halves.back() & 0x7C00u) == 0x7C00u) {
        throw Error({"", name, "the weight " + NumberText(static_cast<double>(weights(j, c))),
                     "magnitudes below 65520 for fp16", "convert with --precision fp32"});
      }
    }
  }
  return halves;
}

}  // namespace dcloth::converter
