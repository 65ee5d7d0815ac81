// The graph-recurrent layer with integer products in double, as gsgru_oracle.h. Inputs may be rounded to levels or not:
// half a level of error each way, which 16 bits make small.
#ifndef DCLOTH_TESTS_UNIT_KERNELS_GSGRU_I8_ORACLE_H_
#define DCLOTH_TESTS_UNIT_KERNELS_GSGRU_I8_ORACLE_H_

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/activation/coarse_tanh.h"
#include "kernels/gsgru/gsgru_i8.h"
#include "tests/unit/kernels/gsgru_oracle.h"

namespace dcloth::kernels {

// x * factor, saturated to 16 bits, within half a level of what any table makes of it. NEON's floats do not saturate:
// beyond the last level the difference is as large as the value.
inline Bounded BoundedLevel(Bounded x, float factor) {
  const double exact = x.value * factor, error = x.error * factor + kUnit * (std::fabs(exact) + x.error * factor);
  const double level = std::clamp(exact, -32768.0, 32767.0);
  return {level, error + 0.5 + std::fabs(exact - level)};
}

// sum + scale of `column` times the integer product of that column.
inline Bounded BoundedIntegers(const GsgruI8Job& job, const BoundedRow& levels, size_t column, Bounded sum) {
  const size_t stride = GsgruI8Columns(job.layer.input_width, job.layer.features);
  double value = 0, error = 0;
  for (size_t k = 0; k < levels.size(); ++k) {
    const double w = job.weights[k * stride + column];
    value += levels[k].value * w;
    error += levels[k].error * std::fabs(w);
  }
  const double scale = job.column_scales[column];
  const double total = sum.value + scale * value, total_error = sum.error + scale * error;
  return {total, total_error + Gamma(2) * (std::fabs(sum.value) + scale * std::fabs(value) + total_error)};
}

inline Bounded BoundedCoarseSigmoid(Bounded x) { return {ExactSigmoid(x.value), x.error / 4 + kCoarseSigmoidMaxError}; }
inline Bounded BoundedCoarseTanh(Bounded x) { return {std::tanh(x.value), x.error + kCoarseTanhMaxError}; }

// h + zp (gp - h gq) / (zq gq) = h + z (g - h): eight roundings of terms no larger than |h| + |g|.
inline Bounded BoundedCoarseBlend(Bounded h, Bounded z, Bounded g) {
  const Bounded blend = BoundedBlend(h, z, g);
  return {blend.value, blend.error + Gamma(8) * (std::fabs(h.value) + std::fabs(g.value) + g.error)};
}

// One vertex; `h` is its state before the call.
inline GsgruExpected ExpectGsgruI8(const GsgruI8Job& job, size_t vertex, const float* h) {
  const GsgruJob& layer = job.layer;
  const size_t width = layer.features, first = GsgruI8Columns(layer.input_width, width) - 4 * width;
  GsgruExpected expected;
  const auto levels_of = [&](const BoundedRow& row, const float* factors) {
    BoundedRow levels;
    for (size_t f = 0; f < row.size(); ++f) {
      levels.push_back(BoundedLevel(row[f], factors != nullptr ? factors[f] : kGsgruHiddenLevels));
    }
    return levels;
  };
  BoundedRow old(width), reset(width);
  for (size_t f = 0; f < width; ++f) old[f].value = h[f];
  const BoundedRow mean = BoundedMean(layer, vertex), old_levels = levels_of(old, nullptr);
  const BoundedRow mean_levels = layer.input_width == 3 ? BoundedRow() : levels_of(mean, job.input_inverse_steps);
  const auto gate = [&](size_t column) {
    const Bounded bias = {layer.gate_bias[column], 0};
    const Bounded input = layer.input_width == 3 ? BoundedProduct(mean, layer.input_gates + column, 3 * width, bias)
                                                 : BoundedIntegers(job, mean_levels, column, bias);
    return column < 2 * width ? BoundedIntegers(job, old_levels, first + column, input) : input;
  };
  for (size_t f = 0; f < width; ++f) reset[f] = BoundedTimes(BoundedCoarseSigmoid(gate(width + f)), old[f]);
  const BoundedRow reset_levels = levels_of(reset, nullptr);
  for (size_t f = 0; f < width; ++f) {
    const Bounded candidate = BoundedIntegers(job, reset_levels, first + 2 * width + f, gate(2 * width + f));
    expected.state.push_back(BoundedCoarseBlend(old[f], BoundedCoarseSigmoid(gate(f)), BoundedCoarseTanh(candidate)));
  }
  const BoundedRow state_levels = levels_of(expected.state, nullptr);
  BoundedRow o;
  for (size_t f = 0; f < width; ++f) {
    o.push_back(BoundedIntegers(job, state_levels, first + 3 * width + f, {layer.output_bias[f], 0}));
  }
  expected.next_x = BoundedNorm(layer, o);
  if (layer.embed != nullptr) {
    expected.s = BoundedProduct(expected.next_x, layer.embed, 1, {layer.embed_bias, 0});
  }
  return expected;
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_TESTS_UNIT_KERNELS_GSGRU_I8_ORACLE_H_
