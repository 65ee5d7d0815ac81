// Plain reference of the graph-recurrent layer: the formulas of gsgru.h, one vertex at a time.
#include "kernels/activation/activation_scalar.h"
#include "kernels/gsgru/gsgru_plain.h"
#include "kernels/kernels.h"
#include "kernels/scalar_math.h"

namespace dcloth::kernels::scalar {
namespace {

constexpr size_t kMax = kGsgruMaxFeatures;

// LayerNorm and PReLU in place.
void NormAndSlope(const GsgruJob& job, float* o) {
  const size_t width = job.features;
  float mean = 0.0f, variance = 0.0f;
  for (size_t f = 0; f < width; ++f) mean += o[f];
  mean /= static_cast<float>(width);
  for (size_t f = 0; f < width; ++f) variance += (o[f] - mean) * (o[f] - mean);
  const float inverse = 1.0f / SquareRoot(variance / static_cast<float>(width) + kGsgruEpsilon);
  for (size_t f = 0; f < width; ++f) {
    const float y = (o[f] - mean) * inverse * job.norm_gain[f] + job.norm_offset[f];
    o[f] = y > 0.0f ? y : job.prelu_slope * y;
  }
}

}  // namespace

void GsgruMean(const GsgruJob& job, size_t vertex, float* mean) {
  const size_t stride = GsgruInputStride(job.input_width);
  const uint32_t begin = job.row_starts[vertex], end = job.row_starts[vertex + 1];
  const float inverse = 1.0f / static_cast<float>(end - begin);
  for (size_t f = 0; f < job.input_width; ++f) {
    float sum = 0.0f;
    for (uint32_t e = begin; e < end; ++e) sum += job.x[job.columns[e] * stride + f];
    mean[f] = sum * inverse;
  }
}

void GsgruAddProduct(const float* x, size_t rows, const float* weights, size_t columns, float* y) {
  for (size_t j = 0; j < rows; ++j) {
    for (size_t c = 0; c < columns; ++c) y[c] += x[j] * weights[j * columns + c];
  }
}

void GsgruFinish(const GsgruJob& job, size_t vertex, float* o) {
  const size_t width = job.features;
  NormAndSlope(job, o);
  if (job.embed != nullptr) {
    float s = job.embed_bias;
    for (size_t f = 0; f < width; ++f) s += o[f] * job.embed[f];
    job.s[vertex] = s;
  } else {
    for (size_t f = 0; f < width; ++f) job.next_x[vertex * width + f] = o[f];
  }
}

void Gsgru(const GsgruJob& job) {
  const size_t width = job.features;
  for (size_t i = 0; i < job.vertices; ++i) {
    float* h = job.state + i * width;
    float mean[kMax], gates[3 * kMax], reset[kMax], o[kMax];
    GsgruMean(job, i, mean);
    for (size_t c = 0; c < 3 * width; ++c) gates[c] = job.gate_bias[c];
    GsgruAddProduct(mean, job.input_width, job.input_gates, 3 * width, gates);
    GsgruAddProduct(h, width, job.hidden_gates, 2 * width, gates);
    const float* z = gates;
    const float* r = gates + width;
    float* candidate = gates + 2 * width;
    for (size_t f = 0; f < width; ++f) reset[f] = SigmoidOf(r[f]) * h[f];
    GsgruAddProduct(reset, width, job.hidden_candidate, width, candidate);
    for (size_t f = 0; f < width; ++f) h[f] += SigmoidOf(z[f]) * (TanhOf(candidate[f]) - h[f]);
    for (size_t f = 0; f < width; ++f) o[f] = job.output_bias[f];
    GsgruAddProduct(h, width, job.output, width, o);
    GsgruFinish(job, i, o);
  }
}

}  // namespace dcloth::kernels::scalar
