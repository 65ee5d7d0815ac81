// Plain reference of the matvec family. Frozen: the oracle of the converter and of every vector source.
#include "kernels/half.h"
#include "kernels/kernels.h"
#include "kernels/matvec/quantize.h"

namespace dcloth::kernels::scalar {
namespace {

float ToFloat(float weight) { return weight; }
float ToFloat(uint16_t weight) { return FloatFromHalf(weight); }

template <typename Job>
void MatvecFloat(const Job& job) {
  for (size_t panel = 0; panel < job.panel_count; ++panel) {
    const auto* weights = job.weights + panel * job.panel_rows * kPanelColumns;
    for (size_t c = 0; c < kPanelColumns; ++c) {
      float sum = 0.0f;
      for (size_t j = 0; j < job.row_count; ++j) sum += job.x[j] * ToFloat(weights[j * kPanelColumns + c]);
      const size_t column = panel * kPanelColumns + c;
      if (job.bias != nullptr) sum += job.bias[column];
      job.y[column] = job.relu && !(sum > 0.0f) ? 0.0f : sum;
    }
  }
}

}  // namespace

void MatvecF32(const MatvecF32Job& job) { MatvecFloat(job); }
void MatvecF16(const MatvecF16Job& job) { MatvecFloat(job); }

void MatvecI8(const MatvecI8Job& job) {
  for (size_t panel = 0; panel < job.panel_count; ++panel) {
    const int8_t* weights = job.weights + panel * job.panel_rows * kPanelColumns;
    for (size_t c = 0; c < kPanelColumns; ++c) {
      uint32_t sum = 0;  // unsigned, so that inputs outside the contract wrap instead of being undefined
      for (size_t j = 0; j < job.row_count; ++j) {
        const int32_t weight = weights[(j / 2 * kPanelColumns + c) * 2 + j % 2];
        sum += static_cast<uint32_t>(job.x[j] * weight);
      }
      const size_t column = panel * kPanelColumns + c;
      float y = static_cast<float>(static_cast<int32_t>(sum)) * job.x_scale * job.column_scales[column];
      if (job.bias != nullptr) y += job.bias[column];
      job.y[column] = job.relu && !(y > 0.0f) ? 0.0f : y;
    }
  }
}

void MatmulI8(const MatmulI8Job& job) {
  for (size_t i = 0; i < job.count; ++i) {
    MatvecI8({job.x + i * job.x_stride, job.weights, job.column_scales, job.bias, job.y + i * job.y_stride,
              job.x_scales[i], job.panel_rows, job.row_count, job.panel_count, job.relu});
  }
}

void QuantizeI16(const QuantizeI16Job& job) {
  const auto product = [&job](size_t j) {
    return FiniteProduct(job.x[j], job.row_scales != nullptr ? job.row_scales[j] : 1.0f);
  };
  float max = 0.0f;
  for (size_t j = 0; j < job.rows; ++j) {
    const float magnitude = FloatFromBits(BitsFromFloat(product(j)) & 0x7FFFFFFFu);
    if (magnitude > max) max = magnitude;
  }
  float step = 1.0f;
  if (max > 0.0f) {
    step = QuantizedStep(max);
    const float inverse = 1.0f / step;
    int64_t sum = 0;
    for (size_t j = 0; j < job.rows; ++j) {
      const int32_t q = RoundToInt(product(j) * inverse);
      sum += q < 0 ? -q : q;
    }
    step *= PowerOfTwo(QuantizedCoarser(sum, job.rows));
  }
  const float inverse = 1.0f / step;
  for (size_t j = 0; j < job.rows; ++j) job.q[j] = static_cast<int16_t>(RoundToInt(product(j) * inverse));
  if (job.rows % 2 != 0) job.q[job.rows] = 0;
  *job.scale = step;
}

}  // namespace dcloth::kernels::scalar
