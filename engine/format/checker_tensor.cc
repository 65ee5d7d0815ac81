// Tensors against the weight vector: dtype, shape, range, overlap; and the linear layers made of them.
#include "engine/format/checker.h"
#include "engine/format/scan.h"
#include "kernels/matvec/matvec.h"

namespace dcloth::format {
namespace {

constexpr uint64_t kWidths[] = {4, 2, 1, 1, 2, 4};  // bytes of DType's values, in order
constexpr const char* kDTypeNames[] = {"f32", "f16", "i8", "u8", "u16", "u32"};

const char* DTypeName(DType dtype) { return dtype <= DType_MAX ? kDTypeNames[dtype] : "an unknown dtype"; }

}  // namespace

bool Checker::ShapeIs(const Path& path, const Tensor* tensor, Shape shape) {
  const flatbuffers::Vector<uint32_t>* found = tensor->shape();
  const uint32_t rank = shape.columns == 0 ? 1 : 2;
  if (found->size() == rank && found->Get(0) == shape.rows && (rank == 1 || found->Get(1) == shape.columns))
    return true;
  char found_text[48], allowed_text[48];
  Text text(found_text, sizeof(found_text));
  text.Add("[");
  for (uint32_t i = 0; i < found->size() && i < 3; ++i) text.Add(i == 0 ? "" : ", ").Add(uint64_t{found->Get(i)});
  text.Add(found->size() > 3 ? ", ...]" : "]");
  Text allowed(allowed_text, sizeof(allowed_text));
  allowed.Add("[").Add(uint64_t{shape.rows});
  if (rank == 2) allowed.Add(", ").Add(uint64_t{shape.columns});
  allowed.Add("]");
  return Fail({&path, "shape"}, tensor, found_text, allowed_text,
              "it must fit the other tensors; convert the bundle again");
}

bool Checker::Claim(const Path& path, const Tensor* tensor, uint64_t size) {
  const Path offset_path = {&path, "offset"};
  const uint64_t offset = tensor->offset();
  if (offset % kAlignment != 0) return FailCount(offset_path, tensor, offset, "", "a multiple of 64");
  if (offset > weights_size_ || size > weights_size_ - offset) {
    char found[96];
    Text(found, sizeof(found)).Add(size).Add(" bytes at offset ").Add(offset);
    char allowed[64];
    Text(allowed, sizeof(allowed)).Add("a range within the ").Add(weights_size_).Add(" bytes of weights");
    return Fail(offset_path, tensor, found, allowed);
  }
  for (size_t i = 0; i < range_count_; ++i) {
    if (offset < ranges_[i].end && ranges_[i].begin < offset + size) {
      char found[96];
      Text(found, sizeof(found)).Add("a range that overlaps the tensor at offset ").Add(ranges_[i].begin);
      return Fail(offset_path, tensor, found, "a separate range for each tensor");
    }
  }
  if (range_count_ == kMaxTensors) return Fail(path, tensor, "more than 160 tensors", "at most 160");
  ranges_[range_count_++] = {offset, offset + size};
  return true;
}

bool Checker::Resolve(const Path& path, const Tensor* tensor, DType dtype, Shape shape, uint64_t stored_elements,
                      const void** values) {
  if (tensor->dtype() != dtype) {
    return Fail({&path, "dtype"}, tensor, DTypeName(tensor->dtype()), DTypeName(dtype));
  }
  // No product wraps: a shape's sides are at most kMaxEdges and 3 * kMaxVertices, widths at most 4.
  if (!ShapeIs(path, tensor, shape) || !Claim(path, tensor, stored_elements * kWidths[dtype])) return false;
  *values = weights_ + tensor->offset();
  return true;
}

bool Checker::Scales(const Path& path, const void* parent, const Tensor* tensor, uint32_t count, const float** values) {
  if (tensor == nullptr) return Fail(path, parent, "no scales for i8 weights", "scales");
  const void* data = nullptr;
  if (!Resolve(path, tensor, DType_F32, {count}, count, &data)) return false;
  const auto* scales = static_cast<const float*>(data);
  const size_t bad = FindNotPositive(scales, count);
  if (bad != count) {  // sound scales are finite too: that pass is for its words alone
    return AllFinite(path, scales, count) &&
           FailElement(path, scales, bad, sizeof(float), "a scale that is not positive",
                       "positive normal numbers, in the padding too");
  }
  *values = scales;
  return true;
}

bool Checker::Integers(const Path& path, const Tensor* tensor, Shape shape, const int8_t** values) {
  const void* found = nullptr;
  const uint64_t count = uint64_t{shape.rows} * shape.columns;
  if (!Resolve(path, tensor, DType_I8, shape, count, &found)) return false;
  *values = static_cast<const int8_t*>(found);
  const size_t bad = FindBelow(*values, count, -127);
  return bad == count || FailElement(path, *values, bad, sizeof(int8_t), "-128", "-127 to 127");
}

bool Checker::LinearScales(const Path& path, const format::Linear* linear, uint32_t padded_columns,
                           RowScales row_scales, LinearView* view) {
  if (view->type == WeightType::kI8) {
    const Path rows = {&path, "row_scales"};
    if (row_scales == RowScales::kNone && linear->row_scales() != nullptr)
      return Fail(rows, linear->row_scales(), "scales of rows", "scales of columns alone in this layer");
    return (row_scales == RowScales::kNone ||
            Scales(rows, linear, linear->row_scales(), view->rows, &view->row_scales)) &&
           Scales({&path, "column_scales"}, linear, linear->column_scales(), padded_columns, &view->column_scales);
  }
  const bool has_rows = linear->row_scales() != nullptr, has_columns = linear->column_scales() != nullptr;
  if (!has_rows && !has_columns) return true;
  return Fail({&path, has_rows ? "row_scales" : "column_scales"}, linear, "scales for float weights",
              "scales only for i8 weights");
}

bool Checker::Linear(const Path& path, const format::Linear* linear, uint32_t rows, uint32_t columns, LinearView* view,
                     RowScales row_scales) {
  const Path weights_path = {&path, "weights"};
  const Tensor* weights = linear->weights();
  const DType dtype = weights->dtype();
  LinearView result = {};
  switch (dtype) {
    case DType_F32:
      result.type = WeightType::kF32;
      break;
    case DType_F16:
      result.type = WeightType::kF16;
      break;
    case DType_I8:
      result.type = WeightType::kI8;
      break;
    default:
      return Fail({&weights_path, "dtype"}, weights, DTypeName(dtype), "f32, f16 or i8");
  }
  result.rows = rows;
  result.columns = columns;
  const auto padded_columns = static_cast<uint32_t>(kernels::PaddedColumns(columns));
  const uint64_t stored_rows = dtype == DType_I8 ? kernels::PairedRows(rows) : rows;
  if (!Resolve(weights_path, weights, dtype, {rows, columns}, stored_rows * padded_columns, &result.weights))
    return false;
  if (!LinearScales(path, linear, padded_columns, row_scales, &result)) return false;
  if (linear->bias() != nullptr && !Floats({&path, "bias"}, linear->bias(), {padded_columns}, &result.bias))
    return false;
  *view = result;
  return true;
}

}  // namespace dcloth::format
