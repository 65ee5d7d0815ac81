// A bundle's tensors, handed out once each and checked: shape, dtype, finite numbers, and what their kind promises.
#ifndef DCLOTH_CONVERTER_TENSOR_READER_H_
#define DCLOTH_CONVERTER_TENSOR_READER_H_

#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "converter/bundle.h"
#include "converter/safetensors.h"

namespace dcloth::converter {

// All functions throw Error with the tensor's name, what was found and what was expected. `names` says in words what
// the expected shape stands for.
class TensorReader {
 public:
  static constexpr uint64_t kAny = UINT64_MAX;  // a free extent, 1 or more: this tensor defines it

  explicit TensorReader(const SafeFile& file) : file_(file) {}

  bool Has(std::string_view prefix) const;  // any tensor whose name begins so

  const SafeTensor& Take(const std::string& name, const Shape& expected, const char* names);
  Matrix TakeMatrix(const std::string& name, uint64_t rows, uint64_t columns, const char* names);
  Vector TakeVector(const std::string& name, uint64_t size, const char* names);
  Vector TakePositive(const std::string& name, uint64_t size, const char* names);                    // 1e-30 to 1e30
  Matrix TakeGeometry(const std::string& name, uint64_t rows, uint64_t columns, const char* names);  // F32 only
  LinearWeights TakeLinear(const std::string& name, uint64_t out, uint64_t in, const char* names);
  Matrix TakeBasis(const std::string& name, uint64_t rows, uint64_t vertices,
                   const char* names);  // [k, n, 3] as [k, 3n]
  std::vector<Matrix> TakeStack(const std::string& name, uint64_t rows, uint64_t columns,
                                const char* names);                                            // 0 or more
  std::vector<uint32_t> TakeMasks(const std::string& name, uint64_t size, const char* names);  // I32, bits 0 to 30
  // I32, 0 to limit - 1, row-major.
  std::vector<uint32_t> TakeIndices(const std::string& name, const Shape& expected, const char* names, uint64_t limit);
  // The first extent as rows, the others as columns.
  Matrix TakeRows(const std::string& name, const Shape& expected, const char* names);
  Faces TakeFaces(const std::string& name, uint64_t vertices);
  Matrix TakeCorners(const std::string& name, uint64_t faces);  // [c, 3, 2] as [3 c, 2]
  // F32, nonnegative, rows sum to 1 within kRowSumTolerance.
  Matrix TakeSkinWeights(const std::string& name, uint64_t rows, uint64_t columns, const char* names);

  void RequireType(const SafeTensor& tensor, SafeType type) const;
  void RefuseUnknown() const;  // tensors that were never taken
  [[noreturn]] void Refuse(const std::string& name, const std::string& found, const std::string& expected) const;

 private:
  const SafeTensor& TakeShaped(const std::string& name, const Shape& expected, const char* names,
                               uint64_t least_leading);
  Matrix ToMatrix(const SafeTensor& tensor, uint64_t rows, uint64_t columns) const;

  const SafeFile& file_;
  std::set<std::string, std::less<>> taken_;
};

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_TENSOR_READER_H_
