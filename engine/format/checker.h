// The checks that every table of a model is made of: counts, tensors, linear layers. Each returns false after it has
// told the Diagnostic, and fills its output only on success.
#ifndef DCLOTH_ENGINE_FORMAT_CHECKER_H_
#define DCLOTH_ENGINE_FORMAT_CHECKER_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/diagnostic.h"
#include "engine/format/schema.h"
#include "engine/format/view.h"

namespace dcloth::format {

// A tensor's logical shape: one or two dimensions.
struct Shape {
  uint32_t rows;
  uint32_t columns = 0;  // 0: one dimension only
  uint64_t elements() const { return columns == 0 ? rows : uint64_t{rows} * columns; }
};

class Checker {
 public:
  // `weights` is the file's weight vector, on kAlignment.
  Checker(const uint8_t* bytes, const uint8_t* weights, uint64_t weights_size, Diagnostic* diagnostic)
      : bytes_(bytes), weights_(weights), weights_size_(weights_size), diagnostic_(diagnostic) {}

  // `place` is any address inside the model bytes.
  bool Fail(const Path& path, const void* place, const char* found, const char* allowed, const char* fix = "");
  bool FailCount(const Path& path, const void* place, uint64_t found, const char* unit, const char* allowed,
                 const char* fix = "");

  bool Count(const Path& path, const void* place, uint64_t found, uint64_t low, uint64_t high);
  bool Finite(const Path& path, const void* place, float value);

  // Terminated, 1 to kMaxNameBytes bytes, no zero byte inside.
  bool Name(const Path& path, const flatbuffers::String* name);

  // Indices of joints, each below `limit`; 1 to kMaxJoints of them unless `low` says otherwise.
  bool Joints(const Path& path, const flatbuffers::Vector<uint16_t>* joints, uint32_t low, uint32_t limit);

  // Reads one dimension of a tensor whose size the file decides, before the tensor itself is checked.
  bool Dimension(const Path& path, const Tensor* tensor, uint32_t dimension, uint32_t low, uint32_t high,
                 uint32_t* size);

  bool Floats(const Path& path, const Tensor* tensor, Shape shape, const float** values);  // finite
  bool WeightRows(const Path& path, const Tensor* tensor, Shape shape, const float** values);
  bool Indices(const Path& path, const Tensor* tensor, Shape shape, uint32_t limit, const uint8_t** values);
  bool Indices(const Path& path, const Tensor* tensor, Shape shape, uint32_t limit, const uint16_t** values);
  bool Integers(const Path& path, const Tensor* tensor, Shape shape, const int8_t** values);  // -127 to 127
  // Normal numbers above 0. `parent` is the place of a tensor that is missing.
  bool Scales(const Path& path, const void* parent, const Tensor* tensor, uint32_t count, const float** values);
  bool Words(const Path& path, const Tensor* tensor, Shape shape, const uint32_t** values);  // any values
  // Each index below `count` once.
  bool Permutation(const Path& path, const Tensor* tensor, uint32_t count, const uint16_t** values);

  // Of int8 weights: with a scale for each row, or for each column alone.
  enum class RowScales : uint8_t { kAll, kNone };

  // A [rows, columns] matrix with its scales and bias. Checks their values, but not the weights': see LinearView.
  bool Linear(const Path& path, const format::Linear* linear, uint32_t rows, uint32_t columns, LinearView* view,
              RowScales row_scales = RowScales::kAll);

  // `element` of a tensor's `values` is bad.
  bool FailElement(const Path& path, const void* values, size_t element, size_t width_bytes, const char* found,
                   const char* allowed, const char* fix = "");

 private:
  struct Range {
    uint64_t begin, end;
  };

  bool Resolve(const Path& path, const Tensor* tensor, DType dtype, Shape shape, uint64_t stored_elements,
               const void** values);
  bool AllFinite(const Path& path, const float* values, size_t count);
  bool ShapeIs(const Path& path, const Tensor* tensor, Shape shape);
  bool Claim(const Path& path, const Tensor* tensor, uint64_t size);
  bool LinearScales(const Path& path, const format::Linear* linear, uint32_t padded_columns, RowScales row_scales,
                    LinearView* view);

  const uint8_t* bytes_;
  const uint8_t* weights_;
  uint64_t weights_size_;
  Diagnostic* diagnostic_;
  Range ranges_[kMaxTensors];  // of the weight vector, claimed by a tensor
  size_t range_count_ = 0;
};

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_CHECKER_H_
