// Matrices and arrays as the model file stores them: bytes in a kernel's layout, and what storing them cost.
#ifndef DCLOTH_CONVERTER_PACK_H_
#define DCLOTH_CONVERTER_PACK_H_

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "converter/bundle.h"
#include "converter/loss.h"
#include "converter/precision.h"
#include "converter/quantize.h"

namespace dcloth::converter {

enum class StoredType : uint8_t { kF32, kF16, kI8, kU8, kU16, kU32 };  // the schema's DType

const char* StoredTypeName(StoredType type);  // "f32"

// What quantising one tensor alone moves the garment by, all others in f32: over all vertices and frames.
struct TensorCost {
  double mean_mm = 0, p99_mm = 0, max_mm = 0;
};

struct TensorReport {
  std::string name;             // the model's field, "mesh_stage.hidden.weights"
  std::string dtype;            // "f32", "f16", "i8", "u8", "u16", "u32"
  std::vector<uint32_t> shape;  // logical
  uint64_t size_bytes = 0;      // stored, padding of the layout included
  TensorLoss loss;
  std::optional<TensorCost> cost;  // empty where stored exactly, and without motion to measure on
};

struct PackedTensor {
  TensorReport report;
  StoredType type = StoredType::kF32;
  std::vector<std::byte> bytes;
};

// y = x W + bias for W [rows, columns].
struct PackedLinear {
  PackedTensor weights;
  std::optional<PackedTensor> row_scales, column_scales;  // int8 only
  std::optional<PackedTensor> bias;
};

// Flat arrays, stored exactly. Values must fit `type`: an index that does not is a bug of the caller.
PackedTensor PackFloats(const std::string& name, const Matrix& values);
PackedTensor PackFloats(const std::string& name, const Vector& values);
PackedTensor PackFloats(const std::string& name, std::vector<uint32_t> shape, const std::vector<float>& values);
PackedTensor PackIndices(const std::string& name, StoredType type, std::vector<uint32_t> shape,
                         const std::vector<uint32_t>& values);

// Pair panels of what is quantised already; `exact` of the same shape is for the report.
PackedLinear PackQuantized(const std::string& name, const Matrix& exact, const QuantizedMatrix& quantized);

// Flat integers with their column scales, row scales 1; no bias.
PackedLinear PackFlatIntegers(const std::string& name, const Matrix& weights);

// Of int8 weights: for rows and columns, or for columns alone.
enum class Int8Scales : uint8_t { kTwoSided, kColumns };

// Panels (f32, f16) or pair panels (int8). `bias` may be empty. Throws Error where fp16 overflows.
PackedLinear PackLinear(const std::string& name, const Matrix& weights, const Vector& bias, Precision precision,
                        Int8Scales scales = Int8Scales::kTwoSided);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_PACK_H_
