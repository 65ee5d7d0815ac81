#include "tests/unit/engine/tensor_writer.h"

#include <algorithm>
#include <cmath>

#include "kernels/half.h"
#include "kernels/matvec/matvec_pack.h"

namespace dcloth::testing {

TensorTable TensorWriter::AddBytes(format::DType dtype, std::vector<uint32_t> shape, const void* values, size_t size) {
  auto tensor = std::make_unique<format::TensorT>();
  tensor->dtype = dtype;
  tensor->shape = std::move(shape);
  tensor->offset = weights_->size();
  const auto* bytes = static_cast<const uint8_t*>(values);
  weights_->insert(weights_->end(), bytes, bytes + size);
  weights_->resize((weights_->size() + 63) / 64 * 64);
  return tensor;
}

TensorTable TensorWriter::Floats(std::vector<uint32_t> shape, const std::vector<float>& values,
                                 std::vector<double>* kept) {
  kept->assign(values.begin(), values.end());
  return Add(format::DType_F32, std::move(shape), values);
}

TensorTable TensorWriter::RandomFloats(std::vector<uint32_t> shape, double low, double high,
                                       std::vector<double>* kept) {
  size_t count = 1;
  for (const uint32_t side : shape) count *= side;
  std::vector<float> values(count);
  for (float& value : values) value = static_cast<float>(Uniform(low, high));
  return Floats(std::move(shape), values, kept);
}

TensorTable TensorWriter::RandomBytes(std::vector<uint32_t> shape, uint32_t limit, std::vector<uint8_t>* kept) {
  kept->resize(size_t{shape[0]} * (shape.size() > 1 ? shape[1] : 1));
  for (uint8_t& value : *kept)
    value = static_cast<uint8_t>(std::uniform_int_distribution<uint32_t>(0, limit - 1)(random_));
  return Add(format::DType_U8, std::move(shape), *kept);
}

void TensorWriter::AddInt8(const std::vector<float>& weights, bool with_row_scales, format::LinearT* table,
                           Linear* kept) {
  const size_t rows = kept->rows, columns = kept->columns;
  std::vector<float> row_scales(rows, 1.0f), column_scales(kernels::PaddedColumns(columns), 1.0f);
  for (float& scale : row_scales) scale = with_row_scales ? static_cast<float>(Uniform(0.5, 1)) : 1.0f;
  std::vector<int8_t> values(rows * columns), packed(kernels::PairPanelElements(rows, columns));
  for (size_t c = 0; c < columns; ++c) {
    double largest = 0;
    for (size_t j = 0; j < rows; ++j) {
      largest = std::max(largest,
                         std::abs(static_cast<double>(weights[j * columns + c])) / static_cast<double>(row_scales[j]));
    }
    if (largest > 0) column_scales[c] = static_cast<float>(largest / 127);
    for (size_t j = 0; j < rows; ++j) {
      const double step = static_cast<double>(row_scales[j]) * static_cast<double>(column_scales[c]);
      const double level = std::clamp(std::round(static_cast<double>(weights[j * columns + c]) / step), -127.0, 127.0);
      values[j * columns + c] = static_cast<int8_t>(level);
      kept->weights[j * columns + c] = step * level;
    }
  }
  kept->row_scales.assign(row_scales.begin(), row_scales.end());
  kernels::PackPairPanelsI8(values.data(), {rows, columns, columns, 1}, packed.data());
  const std::vector<uint32_t> shape = {static_cast<uint32_t>(rows), static_cast<uint32_t>(columns)};
  table->weights = Add(format::DType_I8, shape, packed);
  if (with_row_scales) table->row_scales = Add(format::DType_F32, {shape[0]}, row_scales);
  table->column_scales = Add(format::DType_F32, {static_cast<uint32_t>(column_scales.size())}, column_scales);
}

std::unique_ptr<format::LinearT> TensorWriter::RandomLinear(uint32_t rows, uint32_t columns, double gain, double bias,
                                                            Linear* kept, const LinearKind& kind) {
  auto table = std::make_unique<format::LinearT>();
  kept->rows = rows;
  kept->columns = columns;
  const double reach = 2 * gain / rows;
  std::vector<float> weights(size_t{rows} * columns);
  for (size_t i = 0; i < weights.size(); ++i) {
    const bool zero = kind.zero_rows.count(i / columns) != 0 || kind.zero_columns.count(i % columns) != 0;
    weights[i] = zero ? 0.0f : static_cast<float>(Uniform(-reach, reach));
  }
  kept->weights.assign(weights.begin(), weights.end());
  const kernels::MatrixShape shape = {rows, columns, columns, 1};
  if (precision_ == format::DType_I8) {
    AddInt8(weights, kind.row_scales, table.get(), kept);
  } else if (precision_ == format::DType_F16) {
    std::vector<uint16_t> packed(kernels::PanelElements(rows, columns));
    kernels::PackPanelsF16(weights.data(), shape, packed.data());
    table->weights = Add(format::DType_F16, {rows, columns}, packed);
    for (double& weight : kept->weights) {
      weight = static_cast<double>(kernels::FloatFromHalf(kernels::HalfFromFloat(static_cast<float>(weight))));
    }
  } else {
    std::vector<float> packed(kernels::PanelElements(rows, columns));
    kernels::PackPanelsF32(weights.data(), shape, packed.data());
    table->weights = Add(format::DType_F32, {rows, columns}, packed);
  }
  if (bias != 0) {
    std::vector<float> values(kernels::PaddedColumns(columns), 0.0f);
    for (size_t c = 0; c < columns; ++c) {
      if (kind.zero_columns.count(c) == 0) values[c] = static_cast<float>(Uniform(-bias, bias));
    }
    kept->bias.assign(values.begin(), values.begin() + columns);
    table->bias = Add(format::DType_F32, {static_cast<uint32_t>(values.size())}, values);
  } else {
    kept->bias.assign(columns, 0.0);
  }
  return table;
}

}  // namespace dcloth::testing
