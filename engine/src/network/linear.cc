#include "engine/src/network/linear.h"

namespace dcloth::engine {
namespace {

using format::LinearView;
using format::WeightType;

constexpr size_t kWidth = kernels::kPanelColumns;

// What the three jobs have in common.
template <typename Job, typename Weight>
Job PanelJob(const LinearProduct& product, size_t panel_rows, size_t begin, size_t count, float* out) {
  const LinearView& linear = *product.linear;
  Job job = {};
  job.weights = static_cast<const Weight*>(linear.weights) + begin * panel_rows * kWidth;
  job.bias = linear.bias != nullptr ? linear.bias + begin * kWidth : nullptr;
  job.y = out;
  job.panel_rows = panel_rows;
  job.panel_count = count;
  job.relu = product.activation == Activation::kRelu;
  return job;
}

template <typename Job, typename Weight>
Job FloatJob(const LinearProduct& product, size_t begin, size_t count, float* out) {
  auto job = PanelJob<Job, Weight>(product, product.linear->rows, begin, count, out);
  job.x = product.x;
  job.row_count = product.row_count;
  job.in_order = product.in_order;
  return job;
}

kernels::MatvecI8Job I8Job(const LinearProduct& product, const int16_t* quantized, float x_scale, size_t begin,
                           size_t count, float* out) {
  const size_t panel_rows = kernels::PairedRows(product.linear->rows);
  auto job = PanelJob<kernels::MatvecI8Job, int8_t>(product, panel_rows, begin, count, out);
  job.x = quantized;
  job.column_scales = product.linear->column_scales + begin * kWidth;
  job.x_scale = x_scale;
  job.row_count = kernels::PairedRows(product.row_count);
  return job;
}

// Panel by panel, so that the rest finds the weights in the cache.
void ApplyWithRest(const kernels::KernelTable& kernels, const LinearProduct& product, const InputScales& scales,
                   size_t begin, size_t count, float* out) {
  for (size_t panel = 0; panel < count; ++panel) {
    float* y = out + panel * kWidth;
    kernels::MatvecI8Job job = I8Job(product, product.quantized, scales.x, begin + panel, 1, y);
    job.relu = false;
    kernels.matvec_i8(job);
    job = I8Job(product, product.rest.quantized, scales.rest, begin + panel, 1, y);
    job.bias = y;
    kernels.matvec_i8(job);
  }
}

}  // namespace

size_t QuantizedElements(const LinearView& linear) {
  return linear.type == WeightType::kI8 ? kernels::PairedRows(linear.rows) : 0;
}

size_t PanelBytes(const LinearView& linear, size_t row_count) {
  const size_t width = linear.type == WeightType::kF32 ? 4 : linear.type == WeightType::kF16 ? 2 : 1;
  return row_count * kWidth * width;
}

InputScales QuantizeInput(const kernels::KernelTable& kernels, const LinearProduct& product) {
  InputScales scales;
  const LinearView& linear = *product.linear;
  if (linear.type != WeightType::kI8) return scales;
  const size_t rows = product.row_count;
  kernels.quantize_i16({product.x, linear.row_scales, product.quantized, &scales.x, rows});
  if (product.rest.x == nullptr) return scales;
  for (size_t j = 0; j < rows; ++j) {
    const float x = linear.row_scales != nullptr ? product.x[j] * linear.row_scales[j] : product.x[j];
    product.rest.x[j] = x - static_cast<float>(product.quantized[j]) * scales.x;
  }
  kernels.quantize_i16({product.rest.x, nullptr, product.rest.quantized, &scales.rest, rows});
  return scales;
}

void ApplyPanels(const kernels::KernelTable& kernels, const LinearProduct& product, const InputScales& scales,
                 size_t begin, size_t count) {
  ApplyPanelsTo(kernels, product, scales, begin, count, product.y + begin * kWidth);
}

void ApplyPanelsTo(const kernels::KernelTable& kernels, const LinearProduct& product, const InputScales& scales,
                   size_t begin, size_t count, float* out) {
  switch (product.linear->type) {
    case WeightType::kF32:
      kernels.matvec_f32(FloatJob<kernels::MatvecF32Job, float>(product, begin, count, out));
      break;
    case WeightType::kF16:
      kernels.matvec_f16(FloatJob<kernels::MatvecF16Job, uint16_t>(product, begin, count, out));
      break;
    case WeightType::kI8:
      if (product.rest.x != nullptr) {
        ApplyWithRest(kernels, product, scales, begin, count, out);
      } else {
        kernels.matvec_i8(I8Job(product, product.quantized, scales.x, begin, count, out));
      }
      break;
  }
}

void ApplyLinear(const kernels::KernelTable& kernels, const LinearProduct& product) {
  ApplyPanels(kernels, product, QuantizeInput(kernels, product), 0, kernels::PanelCount(product.linear->columns));
}

void ApplyBatch(const kernels::KernelTable& kernels, const LinearBatch& batch) {
  const LinearView& linear = *batch.linear;
  const size_t panels = kernels::PanelCount(linear.columns), elements = QuantizedElements(linear);
  const auto input = [&](size_t i) {
    return LinearProduct{&linear,          batch.x + i * batch.x_stride,   linear.rows,
                         batch.activation, batch.quantized + i * elements, batch.y + i * batch.y_stride};
  };
  if (linear.type == WeightType::kI8) {
    for (size_t i = 0; i < batch.count; ++i) batch.scales[i] = QuantizeInput(kernels, input(i)).x;
    kernels::MatmulI8Job job = {};
    job.x = batch.quantized;
    job.x_scales = batch.scales;
    job.weights = static_cast<const int8_t*>(linear.weights);
    job.column_scales = linear.column_scales;
    job.bias = linear.bias;
    job.y = batch.y;
    job.count = batch.count;
    job.x_stride = job.panel_rows = job.row_count = elements;
    job.y_stride = batch.y_stride;
    job.panel_count = panels;
    job.relu = batch.activation == Activation::kRelu;
    kernels.matmul_i8(job);
    return;
  }
  for (size_t panel = 0; panel < panels; ++panel) {
    for (size_t i = 0; i < batch.count; ++i) ApplyPanels(kernels, input(i), {}, panel, 1);
  }
}

}  // namespace dcloth::engine
