#include "engine/src/linear.h"

namespace dcloth::engine {
namespace {

using format::LinearView;
using format::WeightType;

template <typename Job, typename Weight>
Job FloatJob(const LinearView& linear, const float* x, size_t row_count, Activation activation, float* y) {
  Job job = {};
  job.x = x;
  job.weights = static_cast<const Weight*>(linear.weights);
  job.bias = linear.bias;
  job.y = y;
  job.panel_rows = linear.rows;
  job.row_count = row_count;
  job.panel_count = kernels::PanelCount(linear.columns);
  job.relu = activation == Activation::kRelu;
  return job;
}

void ApplyI8(const kernels::KernelTable& kernels, const LinearView& linear, const float* x, size_t row_count,
             Activation activation, int16_t* quantized, float* y) {
  float x_scale = 0.0f;
  kernels.quantize_i16({x, linear.row_scales, quantized, &x_scale, row_count});
  kernels::MatvecI8Job job = {};
  job.x = quantized;
  job.weights = static_cast<const int8_t*>(linear.weights);
  job.column_scales = linear.column_scales;
  job.bias = linear.bias;
  job.y = y;
  job.x_scale = x_scale;
  job.panel_rows = kernels::PairedRows(linear.rows);
  job.row_count = kernels::PairedRows(row_count);
  job.panel_count = kernels::PanelCount(linear.columns);
  job.relu = activation == Activation::kRelu;
  kernels.matvec_i8(job);
}

}  // namespace

size_t QuantizedElements(const LinearView& linear) {
  return linear.type == WeightType::kI8 ? kernels::PairedRows(linear.rows) : 0;
}

void ApplyLinear(const kernels::KernelTable& kernels, const LinearView& linear, const float* x, size_t row_count,
                 Activation activation, int16_t* quantized, float* y) {
  switch (linear.type) {
    case WeightType::kF32:
      kernels.matvec_f32(FloatJob<kernels::MatvecF32Job, float>(linear, x, row_count, activation, y));
      break;
    case WeightType::kF16:
      kernels.matvec_f16(FloatJob<kernels::MatvecF16Job, uint16_t>(linear, x, row_count, activation, y));
      break;
    case WeightType::kI8:
      ApplyI8(kernels, linear, x, row_count, activation, quantized, y);
      break;
  }
}

}  // namespace dcloth::engine
