#include "converter/tensor_reader.h"

#include <cmath>
#include <cstring>

#include "converter/error.h"

namespace dcloth::converter {
namespace {

// Above any dimension that makes sense, so that products of two stay far from 64 bits and indices from 32.
constexpr uint64_t kMaxExtent = uint64_t{1} << 24;

}  // namespace

bool TensorReader::Has(std::string_view prefix) const {
  for (const SafeTensor& tensor : file_.tensors()) {
    if (tensor.name.starts_with(prefix)) return true;
  }
  return false;
}

const SafeTensor& TensorReader::TakeShaped(const std::string& name, const Shape& expected, const char* names,
                                           uint64_t least_leading) {
  const SafeTensor& tensor = file_.Require(name);
  taken_.insert(name);
  bool good = tensor.shape.size() == expected.size();
  for (size_t i = 0; good && i < expected.size(); ++i) {
    const uint64_t extent = tensor.shape[i];
    const uint64_t least = i == 0 ? least_leading : 1;
    good = expected[i] == kAny ? extent >= least && extent <= kMaxExtent : extent == expected[i];
  }
  if (good) return tensor;
  std::string text = "[";
  for (size_t i = 0; i < expected.size(); ++i) {
    if (i != 0) text += ", ";
    text += expected[i] == kAny ? std::string("any") : std::to_string(expected[i]);
  }
  Refuse(name, "shape " + ShapeText(tensor.shape), text + "] = " + names);
}

const SafeTensor& TensorReader::Take(const std::string& name, const Shape& expected, const char* names) {
  return TakeShaped(name, expected, names, 1);
}

Matrix TensorReader::ToMatrix(const SafeTensor& tensor, uint64_t rows, uint64_t columns) const {
  const std::vector<float> values = FloatsOf(file_, tensor);
  return Eigen::Map<const Matrix>(values.data(), static_cast<Eigen::Index>(rows), static_cast<Eigen::Index>(columns));
}

Matrix TensorReader::TakeMatrix(const std::string& name, uint64_t rows, uint64_t columns, const char* names) {
  const SafeTensor& tensor = Take(name, {rows, columns}, names);
  return ToMatrix(tensor, tensor.shape[0], tensor.shape[1]);
}

Vector TensorReader::TakeVector(const std::string& name, uint64_t size, const char* names) {
  const std::vector<float> values = FloatsOf(file_, Take(name, {size}, names));
  return Eigen::Map<const Vector>(values.data(), static_cast<Eigen::Index>(values.size()));
}

Vector TensorReader::TakePositive(const std::string& name, uint64_t size, const char* names) {
  Vector values = TakeVector(name, size, names);
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    // Its reciprocal is stored as a float.
    if (!(values[i] >= 1e-30f && values[i] <= 1e30f)) {
      Refuse(name, NumberText(static_cast<double>(values[i])) + " at element " + std::to_string(i), "1e-30 to 1e30");
    }
  }
  return values;
}

Matrix TensorReader::TakeGeometry(const std::string& name, uint64_t rows, uint64_t columns, const char* names) {
  RequireType(Take(name, {rows, columns}, names), SafeType::kF32);  // half floats would move it
  return TakeMatrix(name, rows, columns, names);
}

Matrix TensorReader::TakeCorners(const std::string& name, uint64_t faces) {
  return ToMatrix(Take(name, {faces, 3, 2}, "[c, 3, 2]"), 3 * faces, 2);
}

LinearWeights TensorReader::TakeLinear(const std::string& name, uint64_t out, uint64_t in, const char* names) {
  LinearWeights linear;
  linear.weight = TakeMatrix(name + ".weight", out, in, names);
  linear.bias = TakeVector(name + ".bias", static_cast<uint64_t>(linear.weight.rows()), "the rows of its weight");
  return linear;
}

Matrix TensorReader::TakeBasis(const std::string& name, uint64_t rows, uint64_t vertices, const char* names) {
  const SafeTensor& tensor = Take(name, {rows, vertices, 3}, names);
  return ToMatrix(tensor, tensor.shape[0], 3 * tensor.shape[1]);
}

std::vector<Matrix> TensorReader::TakeStack(const std::string& name, uint64_t rows, uint64_t columns,
                                            const char* names) {
  const SafeTensor& tensor = TakeShaped(name, {kAny, rows, columns}, names, 0);
  const std::vector<float> values = FloatsOf(file_, tensor);
  std::vector<Matrix> stack;
  for (uint64_t i = 0; i < tensor.shape[0]; ++i) {
    stack.emplace_back(Eigen::Map<const Matrix>(values.data() + i * rows * columns, static_cast<Eigen::Index>(rows),
                                                static_cast<Eigen::Index>(columns)));
  }
  return stack;
}

std::vector<uint32_t> TensorReader::TakeMasks(const std::string& name, uint64_t size, const char* names) {
  const SafeTensor& tensor = Take(name, {size}, names);
  RequireType(tensor, SafeType::kI32);
  std::vector<uint32_t> masks(size);
  std::memcpy(masks.data(), tensor.bytes.data(), tensor.bytes.size());
  for (size_t i = 0; i < masks.size(); ++i) {
    if (masks[i] <= INT32_MAX) continue;
    Refuse(name, std::to_string(static_cast<int32_t>(masks[i])) + " at vertex " + std::to_string(i),
           "bit masks of 0 or more");
  }
  return masks;
}

std::vector<uint32_t> TensorReader::TakeIndices(const std::string& name, const Shape& expected, const char* names,
                                                uint64_t limit) {
  const SafeTensor& tensor = Take(name, expected, names);
  RequireType(tensor, SafeType::kI32);
  std::vector<uint32_t> indices(tensor.bytes.size() / sizeof(uint32_t));
  std::memcpy(indices.data(), tensor.bytes.data(), tensor.bytes.size());
  for (size_t i = 0; i < indices.size(); ++i) {
    if (indices[i] < limit) continue;
    Refuse(name, std::to_string(static_cast<int32_t>(indices[i])) + " at element " + std::to_string(i),
           "indices from 0 to " + std::to_string(limit - 1));
  }
  return indices;
}

Matrix TensorReader::TakeRows(const std::string& name, const Shape& expected, const char* names) {
  const SafeTensor& tensor = Take(name, expected, names);
  const uint64_t rows = tensor.shape[0];
  return ToMatrix(tensor, rows, tensor.bytes.size() / SafeTypeSize(tensor.type) / rows);
}

Faces TensorReader::TakeFaces(const std::string& name, uint64_t vertices) {
  const SafeTensor& tensor = Take(name, {kAny, 3}, "[c, 3]");
  RequireType(tensor, SafeType::kI32);
  Faces faces(static_cast<Eigen::Index>(tensor.shape[0]), 3);
  std::memcpy(faces.data(), tensor.bytes.data(), tensor.bytes.size());
  for (Eigen::Index i = 0; i < faces.rows(); ++i) {
    for (Eigen::Index corner = 0; corner < 3; ++corner) {
      const int32_t vertex = faces(i, corner);
      if (vertex < 0 || static_cast<uint64_t>(vertex) >= vertices) {
        Refuse(name, "vertex " + std::to_string(vertex) + " in face " + std::to_string(i),
               "indices from 0 to " + std::to_string(vertices - 1));
      }
    }
    if (faces(i, 0) == faces(i, 1) || faces(i, 1) == faces(i, 2) || faces(i, 0) == faces(i, 2)) {
      Refuse(name, "the same vertex twice in face " + std::to_string(i), "three different vertices");
    }
  }
  return faces;
}

Matrix TensorReader::TakeSkinWeights(const std::string& name, uint64_t rows, uint64_t columns, const char* names) {
  Matrix weights = TakeGeometry(name, rows, columns, names);
  for (Eigen::Index i = 0; i < weights.rows(); ++i) {
    const double sum = weights.row(i).cast<double>().sum();
    if (weights.row(i).minCoeff() < 0) Refuse(name, "a negative weight in row " + std::to_string(i), "0 or more");
    if (std::abs(sum - 1) > kRowSumTolerance) {
      Refuse(name, "a sum of " + NumberText(sum) + " in row " + std::to_string(i), "1 within 0.0001");
    }
  }
  return weights;
}

void TensorReader::RequireType(const SafeTensor& tensor, SafeType type) const {
  if (tensor.type != type) RefuseType(file_, tensor, SafeTypeName(type));
}

void TensorReader::RefuseUnknown() const {
  for (const SafeTensor& tensor : file_.tensors()) {
    if (!taken_.contains(tensor.name)) {
      Refuse(tensor.name, "an unknown tensor", "the tensors in converter/BUNDLE.md");
    }
  }
}

void TensorReader::Refuse(const std::string& name, const std::string& found, const std::string& expected) const {
  throw Error({file_.path(), name, found, expected, "export the bundle again"});
}

}  // namespace dcloth::converter
