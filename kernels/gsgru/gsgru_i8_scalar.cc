// Plain reference of the layer with integer products: the formulas of gsgru_i8.h, one vertex at a time.
#include "kernels/activation/coarse_tanh.h"
#include "kernels/gsgru/gsgru_plain.h"
#include "kernels/kernels.h"
#include "kernels/matvec/quantize.h"

namespace dcloth::kernels::scalar {
namespace {

constexpr size_t kMax = kGsgruMaxFeatures;

// Saturated to 16 bits; NaN to the lowest. Numbers above 2^22 come out too large to matter, those below -2^22 would
// not.
int32_t Rounded(float value) {
  constexpr int32_t kLowest = -32768, kHighest = 32767;
  const int32_t q = value > static_cast<float>(kLowest) ? RoundToInt(value) : kLowest;
  return q > kHighest ? kHighest : q;
}

// y[c] += scale of column first + c times sum_k x[k] W[k][first + c].
void AddProduct(const GsgruI8Job& job, const int32_t* x, size_t first, size_t columns, float* y) {
  const size_t width = job.layer.features, stride = GsgruI8Columns(job.layer.input_width, width);
  for (size_t c = 0; c < columns; ++c) {
    int32_t sum = 0;
    for (size_t k = 0; k < width; ++k) sum += x[k] * job.weights[k * stride + first + c];
    y[c] = static_cast<float>(sum) * job.column_scales[first + c] + y[c];
  }
}

}  // namespace

void GsgruI8Output(const GsgruI8Job& job, const float* h, float* o) {
  const size_t width = job.layer.features;
  int32_t inputs[kMax];
  for (size_t f = 0; f < width; ++f) inputs[f] = Rounded(h[f] * kGsgruHiddenLevels);
  for (size_t f = 0; f < width; ++f) o[f] = job.layer.output_bias[f];
  AddProduct(job, inputs, GsgruI8Columns(job.layer.input_width, width) - width, width, o);
}

void GsgruI8(const GsgruI8Job& job) {
  const GsgruJob& layer = job.layer;
  const size_t width = layer.features, hidden = GsgruI8Columns(layer.input_width, width) - 4 * width;
  for (size_t i = 0; i < layer.vertices; ++i) {
    float* h = layer.state + i * width;
    float mean[kMax], gates[3 * kMax], o[kMax];
    int32_t inputs[kMax];
    GsgruMean(layer, i, mean);
    for (size_t c = 0; c < 3 * width; ++c) gates[c] = layer.gate_bias[c];
    if (layer.input_width == 3) {
      GsgruAddProduct(mean, 3, layer.input_gates, 3 * width, gates);
    } else {
      for (size_t f = 0; f < width; ++f) inputs[f] = Rounded(mean[f] * job.input_inverse_steps[f]);
      AddProduct(job, inputs, 0, 3 * width, gates);
    }
    for (size_t f = 0; f < width; ++f) inputs[f] = Rounded(h[f] * kGsgruHiddenLevels);
    AddProduct(job, inputs, hidden, 2 * width, gates);
    for (size_t f = 0; f < width; ++f) {
      const Fraction r = CoarseSigmoid(gates[width + f]);
      inputs[f] = Rounded(r.p * h[f] / r.q * kGsgruHiddenLevels);
    }
    float* candidate = gates + 2 * width;
    AddProduct(job, inputs, hidden + 2 * width, width, candidate);
    for (size_t f = 0; f < width; ++f) {
      const Fraction g = CoarseTanh(candidate[f]), z = CoarseSigmoid(gates[f]);
      h[f] = h[f] + z.p * (g.p - h[f] * g.q) / (z.q * g.q);
    }
    GsgruI8Output(job, h, o);
    GsgruFinish(layer, i, o);
  }
}

}  // namespace dcloth::kernels::scalar
