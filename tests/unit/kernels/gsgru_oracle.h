// The graph-recurrent layer in double, each value with a bound of what float arithmetic may differ from it.
//
// Running error analysis: a value is (exact on the stored floats, bound of |computed - exact|). Every bound follows
// from Gamma (kernel_test.h), the slopes of the activations and their stated errors; nothing is tuned.
#ifndef DCLOTH_TESTS_UNIT_KERNELS_GSGRU_ORACLE_H_
#define DCLOTH_TESTS_UNIT_KERNELS_GSGRU_ORACLE_H_

#include <cstdint>
#include <vector>

#include "kernels/activation/tanh_rational.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {

// A graph for the tests of the layer: every vertex holds itself, every fifth is otherwise isolated, the hub touches all
// others, the rest have up to 8 more neighbours.
struct Graph {
  static constexpr size_t kHub = 3;
  std::vector<uint32_t> row_starts = {0};
  std::vector<uint16_t> columns;

  Graph(size_t vertices, Random& random) {
    for (size_t i = 0; i < vertices; ++i) {
      columns.push_back(static_cast<uint16_t>(i));
      const size_t extra = i == kHub ? vertices - 1 : i % 5 == 0 ? 0 : 1 + random.Below(8);
      for (size_t k = 0; k < extra; ++k) {
        const size_t other = i == kHub ? (i + 1 + k) % vertices : random.Below(static_cast<uint32_t>(vertices));
        columns.push_back(static_cast<uint16_t>(other));
      }
      row_starts.push_back(static_cast<uint32_t>(columns.size()));
    }
  }
};

struct Bounded {
  double value = 0;
  double error = 0;
};
using BoundedRow = std::vector<Bounded>;

// bias + x W for one column of a flat W.
inline Bounded BoundedProduct(const BoundedRow& x, const float* weights, size_t stride, Bounded bias) {
  double value = bias.value, error = bias.error, size = std::fabs(bias.value) + bias.error;
  for (size_t j = 0; j < x.size(); ++j) {
    const double w = weights[j * stride];
    value += x[j].value * w;
    error += x[j].error * std::fabs(w);
    size += (std::fabs(x[j].value) + x[j].error) * std::fabs(w);
  }
  return {value, error + Gamma(static_cast<double>(x.size()) + 1) * size};
}

inline Bounded BoundedSigmoid(Bounded x) { return {ExactSigmoid(x.value), x.error / 4 + kSigmoidSharedMaxError}; }
inline Bounded BoundedTanh(Bounded x) { return {std::tanh(x.value), x.error + kTanhSharedMaxError}; }

inline Bounded BoundedTimes(Bounded a, Bounded b) {
  const double error = std::fabs(a.value) * b.error + std::fabs(b.value) * a.error + a.error * b.error;
  return {a.value * b.value, error + kUnit * (std::fabs(a.value * b.value) + error)};
}

// h + z (g - h), with three roundings of terms no larger than these sizes.
inline Bounded BoundedBlend(Bounded h, Bounded z, Bounded g) {
  const double difference = std::fabs(g.value - h.value);
  const double error = h.error * (1 - z.value) + z.value * g.error + z.error * (difference + g.error + h.error);
  const double size = std::fabs(h.value) + h.error + (z.value + z.error) * (difference + g.error + h.error);
  return {h.value + z.value * (g.value - h.value), error + Gamma(3) * size};
}

// LayerNorm over the row, then PReLU.
inline BoundedRow BoundedNorm(const GsgruJob& job, const BoundedRow& o) {
  const auto width = static_cast<double>(o.size());
  Bounded mean;
  double size = 0;
  for (const Bounded& value : o) {
    mean.value += value.value / width;
    mean.error += value.error / width;
    size += (std::fabs(value.value) + value.error) / width;
  }
  mean.error += Gamma(width + 1) * size;

  BoundedRow centred;
  double variance = 0, variance_error = 0, squares = 0;
  for (const Bounded& value : o) {
    const double c = value.value - mean.value;
    const double error = value.error + mean.error + kUnit * (std::fabs(c) + value.error + mean.error);
    centred.push_back({c, error});
    variance += c * c / width;
    variance_error += (2 * std::fabs(c) * error + error * error) / width;
    squares += (std::fabs(c) + error) * (std::fabs(c) + error) / width;
  }
  // 1 / sqrt falls, so its change is largest towards the smaller variance; sqrt, sum and division round three times.
  const double shifted = variance + double{kGsgruEpsilon};
  variance_error += Gamma(width + 3) * (squares + double{kGsgruEpsilon});
  const double inverse = 1 / std::sqrt(shifted);
  const double inverse_worst = 1 / std::sqrt(std::max(shifted - variance_error, double{kGsgruEpsilon} / 2));
  const Bounded scale = {inverse, inverse_worst - inverse + Gamma(3) * inverse_worst};

  BoundedRow next;
  for (size_t f = 0; f < o.size(); ++f) {
    Bounded y = BoundedTimes(BoundedTimes(centred[f], scale), {job.norm_gain[f], 0});
    y.value += job.norm_offset[f];
    y.error += Gamma(2) * (std::fabs(y.value) + std::fabs(job.norm_offset[f]) + y.error);
    const double slope = std::fabs(double{job.prelu_slope});
    const double value = y.value > 0 ? y.value : job.prelu_slope * y.value;
    next.push_back({value, std::max(1.0, slope) * (y.error + kUnit * (std::fabs(y.value) + y.error))});
  }
  return next;
}

// The mean over a vertex's neighbours.
inline BoundedRow BoundedMean(const GsgruJob& job, size_t vertex) {
  const size_t stride = GsgruInputStride(job.input_width);
  const uint32_t begin = job.row_starts[vertex], end = job.row_starts[vertex + 1];
  const double valence = end - begin;
  BoundedRow mean(job.input_width);
  for (size_t f = 0; f < job.input_width; ++f) {
    double size = 0;
    for (uint32_t e = begin; e < end; ++e) {
      mean[f].value += job.x[job.columns[e] * stride + f] / valence;
      size += std::fabs(job.x[job.columns[e] * stride + f]) / valence;
    }
    mean[f].error = Gamma(valence + 2) * size;
  }
  return mean;
}

struct GsgruExpected {
  BoundedRow state;   // h', [F]
  BoundedRow next_x;  // [F]
  Bounded s;          // where the job embeds
};

// One vertex; `h` is its state before the call.
inline GsgruExpected ExpectGsgru(const GsgruJob& job, size_t vertex, const float* h) {
  const size_t width = job.features;
  const BoundedRow mean = BoundedMean(job, vertex);
  BoundedRow old(width), gated(width);
  for (size_t f = 0; f < width; ++f) old[f].value = h[f];
  const auto gate = [&](size_t column) {
    const Bounded input = BoundedProduct(mean, job.input_gates + column, 3 * width, {job.gate_bias[column], 0});
    return column < 2 * width ? BoundedProduct(old, job.hidden_gates + column, 2 * width, input) : input;
  };
  for (size_t f = 0; f < width; ++f) gated[f] = BoundedTimes(BoundedSigmoid(gate(width + f)), old[f]);

  GsgruExpected expected;
  for (size_t f = 0; f < width; ++f) {
    const Bounded candidate = BoundedProduct(gated, job.hidden_candidate + f, width, gate(2 * width + f));
    expected.state.push_back(BoundedBlend(old[f], BoundedSigmoid(gate(f)), BoundedTanh(candidate)));
  }
  BoundedRow o;
  for (size_t f = 0; f < width; ++f) {
    o.push_back(BoundedProduct(expected.state, job.output + f, width, {job.output_bias[f], 0}));
  }
  expected.next_x = BoundedNorm(job, o);
  if (job.embed != nullptr) expected.s = BoundedProduct(expected.next_x, job.embed, 1, {job.embed_bias, 0});
  return expected;
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_TESTS_UNIT_KERNELS_GSGRU_ORACLE_H_
