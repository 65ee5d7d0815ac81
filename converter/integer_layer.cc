#include "converter/integer_layer.h"

#include <algorithm>
#include <cmath>

#include "kernels/gsgru/gsgru_i8.h"

namespace dcloth::converter {
namespace {

// Largest |next x| of each feature that a step has to reach.
VectorD LargestOutputs(const MeshLayerWeights& layer) {
  constexpr double kMostDeviations = 4;
  constexpr double kSmallest = 1e-6;  // a feature that is always zero
  const auto features = static_cast<double>(layer.norm_weight.size());
  const double deviations = std::min(std::sqrt(features - 1), kMostDeviations);
  const double slope = std::max(1.0, std::abs(static_cast<double>(layer.prelu)));
  const VectorD gain = layer.norm_weight.cast<double>().cwiseAbs(), offset = layer.norm_bias.cast<double>().cwiseAbs();
  return (slope * (deviations * gain + offset)).cwiseMax(kSmallest);
}

}  // namespace

IntegerLayer StackIntegerLayer(const FoldedMeshLayer& layer, const Matrix& output, const MeshLayerWeights* before) {
  constexpr double kLevels = 32767, kHiddenLevels = static_cast<double>(kernels::kGsgruHiddenLevels);
  const Eigen::Index width = output.rows(), inputs = before == nullptr ? 0 : 3 * width;
  IntegerLayer stored;
  MatrixD weights(width, inputs + 4 * width);
  if (before != nullptr) {
    const VectorD steps = LargestOutputs(*before) / kLevels;
    weights.leftCols(inputs) = steps.asDiagonal() * layer.input_gates.cast<double>();
    stored.input_inverse_steps = steps.cwiseInverse().cast<float>();
  }
  weights.rightCols(4 * width) << layer.hidden_gates.cast<double>(), layer.hidden_candidate.cast<double>(),
      output.cast<double>();
  weights.rightCols(4 * width) /= kHiddenLevels;
  stored.weights = weights.cast<float>();
  return stored;
}

}  // namespace dcloth::converter
