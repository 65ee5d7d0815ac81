#include "engine/format/checker.h"

#include <cstring>

#include "engine/format/scan.h"

namespace dcloth::format {
namespace {

constexpr char kRewrite[] = "convert the bundle again";

const char* FloatFault(float value) {
  if (value != value) return "NaN";
  return value > 3.402823466e38f || value < -3.402823466e38f ? "infinity" : "a number out of range";
}

}  // namespace

bool Checker::Fail(const Path& path, const void* place, const char* found, const char* allowed, const char* fix) {
  const auto offset = static_cast<uint64_t>(static_cast<const uint8_t*>(place) - bytes_);
  return diagnostic_->Fail(DCLOTH_ERROR_SEMANTICS, offset, &path, found, allowed, *fix != '\0' ? fix : kRewrite);
}

bool Checker::FailCount(const Path& path, const void* place, uint64_t found, const char* unit, const char* allowed,
                        const char* fix) {
  char number[64];
  Text(number, sizeof(number)).Add(found).Add(unit);
  return Fail(path, place, number, allowed, fix);
}

bool Checker::FailElement(const Path& path, const void* values, size_t element, size_t width_bytes, const char* found,
                          const char* allowed, const char* fix) {
  const Path at = {&path, nullptr, static_cast<int64_t>(element)};
  return Fail(at, static_cast<const uint8_t*>(values) + element * width_bytes, found, allowed, fix);
}

bool Checker::Count(const Path& path, const void* place, uint64_t found, uint64_t low, uint64_t high) {
  if (found >= low && found <= high) return true;
  char allowed[64];
  Text text(allowed, sizeof(allowed));
  text.Add(low);
  if (high != low) text.Add(" to ").Add(high);
  return FailCount(path, place, found, "", allowed);
}

bool Checker::Finite(const Path& path, const void* place, float value) {
  return FindNotFinite(&value, 1) == 1 || Fail(path, place, FloatFault(value), "a finite number");
}

bool Checker::Name(const Path& path, const flatbuffers::String* name) {
  if (!Count({&path, "length"}, name, name->size(), 1, kMaxNameBytes)) return false;
  if (std::memchr(name->c_str(), 0, name->size()) == nullptr) return true;
  return Fail(path, name, "a zero byte inside the text", "text without zero bytes");
}

bool Checker::Joints(const Path& path, const flatbuffers::Vector<uint16_t>* joints, uint32_t low, uint32_t limit) {
  if (!Count({&path, "length"}, joints, joints->size(), low, kMaxJoints)) return false;
  for (uint32_t i = 0; i < joints->size(); ++i) {
    if (joints->Get(i) >= limit) {
      const Path at = {&path, nullptr, i};
      return FailCount(at, joints->Data() + size_t{i} * 2, joints->Get(i), "", "an index into character.joint_names");
    }
  }
  return true;
}

bool Checker::Dimension(const Path& path, const Tensor* tensor, uint32_t dimension, uint32_t low, uint32_t high,
                        uint32_t* size) {
  const Path shape = {&path, "shape"};
  if (tensor->shape()->size() <= dimension) {
    return FailCount(shape, tensor, tensor->shape()->size(), " dimensions", dimension == 0 ? "1 or 2" : "2");
  }
  const uint32_t found = tensor->shape()->Get(dimension);
  if (!Count({&shape, nullptr, dimension}, tensor, found, low, high)) return false;
  *size = found;
  return true;
}

bool Checker::Floats(const Path& path, const Tensor* tensor, Shape shape, const float** values) {
  const void* data = nullptr;
  if (!Resolve(path, tensor, DType_F32, shape, shape.elements(), &data)) return false;
  const auto* floats = static_cast<const float*>(data);
  if (!AllFinite(path, floats, shape.elements())) return false;
  *values = floats;
  return true;
}

bool Checker::AllFinite(const Path& path, const float* values, size_t count) {
  const size_t bad = FindNotFinite(values, count);
  return bad == count || FailElement(path, values, bad, sizeof(float), FloatFault(values[bad]), "finite numbers");
}

bool Checker::WeightRows(const Path& path, const Tensor* tensor, Shape shape, const float** values) {
  const void* data = nullptr;
  if (!Resolve(path, tensor, DType_F32, shape, shape.elements(), &data)) return false;
  *values = static_cast<const float*>(data);
  const size_t bad = FindBadWeightRow(*values, shape.rows, shape.columns);
  if (bad == shape.rows) return true;  // such rows are finite
  return AllFinite(path, *values, shape.elements()) &&
         FailElement(path, *values, bad, sizeof(float) * shape.columns,
                     "a row with a negative weight, or with a sum other than 1",
                     "weights of 0 or more whose sum is 1 within 1e-4");
}

bool Checker::Indices(const Path& path, const Tensor* tensor, Shape shape, uint32_t limit, const uint8_t** values) {
  const void* data = nullptr;
  if (!Resolve(path, tensor, DType_U8, shape, shape.elements(), &data)) return false;
  const auto* indices = static_cast<const uint8_t*>(data);
  const size_t bad = FindNotBelow(indices, shape.elements(), limit);
  char found[32], allowed[32];
  if (bad != shape.elements()) {
    Text(found, sizeof(found)).Add(uint64_t{indices[bad]});
    Text(allowed, sizeof(allowed)).Add("indices below ").Add(uint64_t{limit});
    return FailElement(path, data, bad, 1, found, allowed);
  }
  *values = indices;
  return true;
}

bool Checker::Indices(const Path& path, const Tensor* tensor, Shape shape, uint32_t limit, const uint16_t** values) {
  const void* data = nullptr;
  if (!Resolve(path, tensor, DType_U16, shape, shape.elements(), &data)) return false;
  const auto* indices = static_cast<const uint16_t*>(data);
  const size_t bad = FindNotBelow(indices, shape.elements(), limit);
  char found[32], allowed[32];
  if (bad != shape.elements()) {
    Text(found, sizeof(found)).Add(uint64_t{indices[bad]});
    Text(allowed, sizeof(allowed)).Add("indices below ").Add(uint64_t{limit});
    return FailElement(path, data, bad, 2, found, allowed);
  }
  *values = indices;
  return true;
}

bool Checker::Permutation(const Path& path, const Tensor* tensor, uint32_t count, const uint16_t** values) {
  if (!Indices(path, tensor, {count}, count, values)) return false;
  size_t repeated = FindRepeated(*values, count, count);
  for (uint32_t i = 1; i < repeated && i < count; ++i) {
    if ((*values)[i] == (*values)[i - 1]) repeated = i;
  }
  return repeated == count || FailElement(path, *values, repeated, sizeof(uint16_t), "a vertex that is there twice",
                                          "every garment vertex once");
}

bool Checker::Words(const Path& path, const Tensor* tensor, Shape shape, const uint32_t** values) {
  const void* data = nullptr;
  if (!Resolve(path, tensor, DType_U32, shape, shape.elements(), &data)) return false;
  *values = static_cast<const uint32_t*>(data);
  return true;
}

}  // namespace dcloth::format
