#include "converter/pack.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>
#include <span>
#include <utility>

#include "converter/quantize.h"
#include "kernels/half.h"
#include "kernels/matvec/matvec_pack.h"

namespace dcloth::converter {
namespace {

std::vector<std::byte> BytesOf(const auto& values) {
  const auto bytes = std::as_bytes(std::span(values));
  return {bytes.begin(), bytes.end()};
}

PackedTensor Finish(const std::string& name, StoredType type, std::vector<uint32_t> shape, std::vector<std::byte> bytes,
                    const TensorLoss& loss) {
  PackedTensor packed;
  packed.report = {name, StoredTypeName(type), std::move(shape), bytes.size(), loss, {}};
  packed.type = type;
  packed.bytes = std::move(bytes);
  return packed;
}

std::vector<uint32_t> ShapeOf(const Matrix& matrix) {
  return {static_cast<uint32_t>(matrix.rows()), static_cast<uint32_t>(matrix.cols())};
}

// A bias or column scales, filled up for the padding columns.
PackedTensor PackColumns(const std::string& name, std::vector<float> values, float fill) {
  values.resize(kernels::PaddedColumns(values.size()), fill);
  const auto size = static_cast<uint32_t>(values.size());
  return PackFloats(name, {size}, values);
}

}  // namespace

const char* StoredTypeName(StoredType type) {
  constexpr const char* kNames[] = {"f32", "f16", "i8", "u8", "u16", "u32"};
  return kNames[static_cast<size_t>(type)];
}

PackedTensor PackFloats(const std::string& name, const Matrix& values) {
  const std::span<const float> flat(values.data(), static_cast<size_t>(values.size()));
  return Finish(name, StoredType::kF32, ShapeOf(values), BytesOf(flat), ExactLoss(flat));
}

PackedTensor PackFloats(const std::string& name, const Vector& values) {
  const std::span<const float> flat(values.data(), static_cast<size_t>(values.size()));
  return Finish(name, StoredType::kF32, {static_cast<uint32_t>(flat.size())}, BytesOf(flat), ExactLoss(flat));
}

PackedTensor PackFloats(const std::string& name, std::vector<uint32_t> shape, const std::vector<float>& values) {
  return Finish(name, StoredType::kF32, std::move(shape), BytesOf(values), ExactLoss(values));
}

PackedTensor PackIndices(const std::string& name, StoredType type, std::vector<uint32_t> shape,
                         const std::vector<uint32_t>& values) {
  std::vector<std::byte> bytes;
  if (type == StoredType::kU8) {
    bytes = BytesOf(std::vector<uint8_t>(values.begin(), values.end()));
  } else if (type == StoredType::kU16) {
    bytes = BytesOf(std::vector<uint16_t>(values.begin(), values.end()));
  } else {
    bytes = BytesOf(values);
  }
  // Indices of a model's mesh stay below 2^24: exact as floats.
  const std::vector<float> floats(values.begin(), values.end());
  return Finish(name, type, std::move(shape), std::move(bytes), ExactLoss(floats));
}

PackedLinear PackQuantized(const std::string& name, const Matrix& exact, const QuantizedMatrix& quantized) {
  const size_t rows = quantized.rows, columns = quantized.columns;
  std::vector<int8_t> packed(kernels::PairPanelElements(rows, columns));
  kernels::PackPairPanelsI8(quantized.values.data(), {rows, columns, columns, 1}, packed.data());
  PackedLinear linear;
  linear.weights =
      Finish(name + ".weights", StoredType::kI8, ShapeOf(exact), BytesOf(packed), LossOf(exact, quantized));
  linear.row_scales = PackFloats(name + ".row_scales", {static_cast<uint32_t>(rows)}, quantized.row_scales);
  linear.column_scales = PackColumns(name + ".column_scales", quantized.column_scales, 1.0f);
  return linear;
}

PackedLinear PackFlatIntegers(const std::string& name, const Matrix& weights) {
  const QuantizedMatrix quantized = QuantizePerColumn(name + ".weights", weights);
  PackedLinear linear;
  linear.weights = Finish(name + ".weights", StoredType::kI8, ShapeOf(weights), BytesOf(quantized.values),
                          LossOf(weights, quantized));
  linear.column_scales =
      PackFloats(name + ".column_scales", {static_cast<uint32_t>(quantized.columns)}, quantized.column_scales);
  return linear;
}

PackedLinear PackLinear(const std::string& name, const Matrix& weights, const Vector& bias, Precision precision,
                        Int8Scales scales) {
  const auto rows = static_cast<size_t>(weights.rows()), columns = static_cast<size_t>(weights.cols());
  const kernels::MatrixShape shape = {rows, columns, columns, 1};
  const std::string field = name + ".weights";
  PackedLinear linear;
  if (precision == Precision::kInt8) {
    const bool two_sided = scales == Int8Scales::kTwoSided;
    linear =
        PackQuantized(name, weights, two_sided ? QuantizeTwoSided(field, weights) : QuantizePerColumn(field, weights));
    if (!two_sided) linear.row_scales.reset();
  } else if (precision == Precision::kFp16) {
    const std::vector<uint16_t> halves = QuantizeHalf(field, weights);  // for its overflow check and the report
    std::vector<uint16_t> packed(kernels::PanelElements(rows, columns));
    kernels::PackPanelsF16(weights.data(), shape, packed.data());
    linear.weights = Finish(field, StoredType::kF16, ShapeOf(weights), BytesOf(packed), LossOf(weights, halves));
  } else {
    std::vector<float> packed(kernels::PanelElements(rows, columns));
    kernels::PackPanelsF32(weights.data(), shape, packed.data());
    linear.weights = Finish(field, StoredType::kF32, ShapeOf(weights), BytesOf(packed),
                            ExactLoss({weights.data(), static_cast<size_t>(weights.size())}));
  }
  if (bias.size() != 0) {
    linear.bias = PackColumns(name + ".bias", std::vector<float>(bias.data(), bias.data() + bias.size()), 0.0f);
  }
  return linear;
}

}  // namespace dcloth::converter
