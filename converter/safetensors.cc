#include "converter/safetensors.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <utility>

#include "converter/error.h"
#include "converter/foreign_file.h"
#include "converter/safetensors_header.h"
#include "kernels/half.h"

namespace dcloth::converter {
namespace {

static_assert(std::endian::native == std::endian::little, "files are little-endian and are used as they are");

struct TypeInfo {
  SafeType type;
  const char* name;
  size_t size;
};
constexpr TypeInfo kTypes[] = {{SafeType::kBool, "BOOL", 1}, {SafeType::kU8, "U8", 1},   {SafeType::kI8, "I8", 1},
                               {SafeType::kU16, "U16", 2},   {SafeType::kI16, "I16", 2}, {SafeType::kF16, "F16", 2},
                               {SafeType::kBF16, "BF16", 2}, {SafeType::kU32, "U32", 4}, {SafeType::kI32, "I32", 4},
                               {SafeType::kF32, "F32", 4},   {SafeType::kU64, "U64", 8}, {SafeType::kI64, "I64", 8},
                               {SafeType::kF64, "F64", 8}};

// Ranges must tile the data: sorted, each begins where the one before it ended, and the last ends with the file.
void CheckTiling(const std::filesystem::path& path, const std::vector<HeaderTensor>& tensors, uint64_t data_bytes) {
  std::vector<const HeaderTensor*> order;
  order.reserve(tensors.size());
  for (const HeaderTensor& tensor : tensors) order.push_back(&tensor);
  std::sort(order.begin(), order.end(), [](const HeaderTensor* a, const HeaderTensor* b) {
    return std::pair(a->begin, a->end) < std::pair(b->begin, b->end);
  });
  uint64_t at = 0;
  for (const HeaderTensor* tensor : order) {
    if (tensor->end > data_bytes) {
      throw Error({path, tensor->name, "a tensor that ends at data byte " + std::to_string(tensor->end),
                   "at most " + std::to_string(data_bytes), "the file is cut off; copy it again"});
    }
    if (tensor->begin != at) {
      throw Error({path, tensor->name, "a tensor that begins at data byte " + std::to_string(tensor->begin),
                   std::to_string(at) + (tensor->begin < at ? " (tensors overlap)" : " (a hole)"),
                   "write the file again with a safetensors library"});
    }
    at = tensor->end;
  }
  if (at != data_bytes) {
    throw Error({path, "", std::to_string(data_bytes - at) + " bytes after the last tensor", "none",
                 "write the file again with a safetensors library"});
  }
}

}  // namespace

const char* SafeTypeName(SafeType type) { return kTypes[static_cast<size_t>(type)].name; }
size_t SafeTypeSize(SafeType type) { return kTypes[static_cast<size_t>(type)].size; }

std::optional<SafeType> ParseSafeType(std::string_view name) {
  for (const TypeInfo& info : kTypes) {
    if (name == info.name) return info.type;
  }
  return std::nullopt;
}

std::string ShapeText(const Shape& shape) {
  std::string text = "[";
  for (size_t i = 0; i < shape.size(); ++i) text += (i == 0 ? "" : ", ") + std::to_string(shape[i]);
  return text + "]";
}

bool LooksLikeSafetensors(std::span<const std::byte> file) {
  uint64_t header_bytes = 0;
  if (file.size() <= sizeof(header_bytes)) return false;
  std::memcpy(&header_bytes, file.data(), sizeof(header_bytes));
  return header_bytes <= file.size() - sizeof(header_bytes) && file[sizeof(header_bytes)] == std::byte{'{'};
}

uint64_t SafeTensor::count() const { return bytes.size() / SafeTypeSize(type); }

SafeFile SafeFile::Read(const std::filesystem::path& path) { return Parse(ReadFile(path), path); }

SafeFile SafeFile::Parse(AlignedBytes bytes, std::filesystem::path path) {
  SafeFile file;
  file.path_ = std::move(path);
  file.bytes_ = std::move(bytes);
  const size_t size = file.bytes_.size();
  if (size < 8)
    throw Error({file.path_, "", std::to_string(size) + " bytes", "a safetensors file of 8 bytes or more",
                 "copy the file again"});
  uint64_t header_bytes = 0;
  std::memcpy(&header_bytes, file.bytes_.data(), 8);
  if (header_bytes > std::min<uint64_t>(size - 8, kMaxHeaderBytes)) {
    if (std::memcmp(file.bytes_.data() + 4, "DCLO", 4) == 0) {  // such a length would be beyond every file
      throw Error({file.path_, "", "a .dcloth model", "a safetensors file",
                   "pass the training bundle that the model was made from, or a sequence"});
    }
    if (const ForeignFile foreign = ForeignFileOf(file.bytes_); foreign.name != nullptr) {
      throw Error({file.path_, "", foreign.name, "a safetensors file", foreign.mend});
    }
    throw Error({file.path_, "", "a header of " + std::to_string(header_bytes) + " bytes",
                 "at most " + std::to_string(std::min<uint64_t>(size - 8, kMaxHeaderBytes)),
                 "the file is cut off, or it is not a safetensors file"});
  }
  const char* const json = reinterpret_cast<const char*>(file.bytes_.data()) + 8;
  Header header = ParseHeader(file.path_, {json, static_cast<size_t>(header_bytes)});
  const std::span<const std::byte> data = std::span(file.bytes_).subspan(8 + header_bytes);
  CheckTiling(file.path_, header.tensors, data.size());
  for (HeaderTensor& tensor : header.tensors) {
    file.tensors_.push_back({std::move(tensor.name), tensor.type, std::move(tensor.shape),
                             data.subspan(tensor.begin, tensor.end - tensor.begin)});
  }
  file.metadata_ = std::move(header.metadata);
  return file;
}

const SafeTensor* SafeFile::Find(std::string_view name) const {
  const auto found =
      std::find_if(tensors_.begin(), tensors_.end(), [&](const SafeTensor& t) { return t.name == name; });
  return found == tensors_.end() ? nullptr : &*found;
}

const SafeTensor& SafeFile::Require(std::string_view name) const {
  const SafeTensor* const tensor = Find(name);
  if (tensor == nullptr)
    throw Error({path_, std::string(name), "no such tensor", "this tensor", "see converter/BUNDLE.md"});
  return *tensor;
}

const std::string& SafeFile::RequireMetadata(std::string_view key) const {
  const auto found = metadata_.find(key);
  if (found == metadata_.end()) {
    throw Error({path_, "", "no metadata '" + std::string(key) + "'", "this metadata", "see converter/BUNDLE.md"});
  }
  return found->second;
}

std::string RewriteCommand(const std::string& items) {
  return "run python3 -c \"from safetensors import safe_open, torch as t; t.save_file({" + items +
         " for k, v in t.load_file('old.safetensors').items()}, 'new.safetensors', "
         "safe_open('old.safetensors', 'pt').metadata())\"";
}

void RefuseType(const SafeFile& file, const SafeTensor& tensor, const std::string& expected) {
  const auto cast = [](const char* to, const char* from) {
    return RewriteCommand("k: v." + std::string(to) + "() if str(v.dtype) == 'torch." + from + "' else v");
  };
  std::string mend = "export the file again";
  if (tensor.type == SafeType::kF64) mend = cast("float", "float64");
  if (tensor.type == SafeType::kF16) mend = cast("float", "float16");
  if (tensor.type == SafeType::kBF16) mend = cast("float", "bfloat16");
  if (tensor.type == SafeType::kI64) mend = cast("int", "int64");
  throw Error({file.path(), tensor.name, std::string("dtype ") + SafeTypeName(tensor.type), expected, mend});
}

std::vector<float> FloatsOf(const SafeFile& file, const SafeTensor& tensor) {
  std::vector<float> values(tensor.count());
  if (tensor.type == SafeType::kF32) {
    if (!values.empty()) std::memcpy(values.data(), tensor.bytes.data(), tensor.bytes.size());
  } else if (tensor.type == SafeType::kF16) {
    for (size_t i = 0; i < values.size(); ++i) {
      uint16_t half;
      std::memcpy(&half, tensor.bytes.data() + 2 * i, 2);
      values[i] = kernels::FloatFromHalf(half);
    }
  } else {
    RefuseType(file, tensor, "F32 or F16");
  }
  for (size_t i = 0; i < values.size(); ++i) {
    if (!std::isfinite(values[i])) {
      throw Error({file.path(), tensor.name,
                   (std::isnan(values[i]) ? "NaN" : "infinity") + std::string(" at element ") + std::to_string(i),
                   "finite numbers", "check whether training or simulation diverged"});
    }
  }
  return values;
}

std::string SafeHeader(std::span<const SafeTensor> tensors, const Metadata& metadata) {
  nlohmann::ordered_json root = nlohmann::ordered_json::object();
  if (!metadata.empty()) root["__metadata__"] = metadata;
  std::set<std::string_view> names;
  uint64_t at = 0;
  for (const SafeTensor& tensor : tensors) {
    if (tensor.name == "__metadata__" || !names.insert(tensor.name).second) {
      throw Error({"", tensor.name, "a name that is reserved or occurs twice", "unique names", ""});
    }
    const std::optional<uint64_t> size = CheckedSize(tensor.type, tensor.shape);
    if (!size || *size != tensor.bytes.size() || tensor.shape.size() > kMaxDimensions) {
      throw Error({"", tensor.name, std::to_string(tensor.bytes.size()) + " bytes",
                   std::string("the bytes of ") + SafeTypeName(tensor.type) + " " + ShapeText(tensor.shape), ""});
    }
    nlohmann::ordered_json& entry = root[tensor.name];
    entry["dtype"] = SafeTypeName(tensor.type);
    entry["shape"] = tensor.shape;
    entry["data_offsets"] = {at, at + *size};
    at += *size;
  }
  std::string text;
  try {
    text = root.dump();
  } catch (const nlohmann::json::type_error&) {
    throw Error({"", "", "a tensor name or metadata that is not UTF-8", "UTF-8", ""});
  }
  text.append((8 - text.size() % 8) % 8, ' ');
  return text;
}

void WriteSafetensors(const std::filesystem::path& path, std::span<const SafeTensor> tensors,
                      const Metadata& metadata) {
  const std::string header = SafeHeader(tensors, metadata);
  const uint64_t header_bytes = header.size();
  std::vector<std::span<const std::byte>> pieces = {std::as_bytes(std::span(&header_bytes, 1)),
                                                    std::as_bytes(std::span(header))};
  for (const SafeTensor& tensor : tensors) pieces.push_back(tensor.bytes);
  WriteFileAtomically(path, pieces);
}

}  // namespace dcloth::converter
