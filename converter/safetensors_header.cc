#include "converter/safetensors_header.h"

#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "converter/error.h"

namespace dcloth::converter {
namespace {

constexpr std::string_view kMetadataKey = "__metadata__";

// States are the places of the only document shape that is allowed:
// {"__metadata__": {"k": "v"}, "name": {"dtype": "F32", "shape": [1], "data_offsets": [0, 4]}}.
class Handler : public nlohmann::json_sax<nlohmann::json> {
 public:
  Handler(const std::filesystem::path& path, Header* header) : path_(path), header_(header) {}

  bool null() override { return Unexpected("null"); }
  bool boolean(bool) override { return Unexpected("a boolean"); }
  bool number_integer(number_integer_t value) override { return Unexpected("the number " + std::to_string(value)); }
  bool number_float(number_float_t, const string_t& text) override { return Unexpected("the number " + text); }
  bool binary(binary_t&) override { return Unexpected("binary data"); }

  bool number_unsigned(number_unsigned_t value) override {
    if (place_ != Place::kList) return Unexpected("the number " + std::to_string(value));
    const bool offsets = field_ == "data_offsets";
    std::vector<uint64_t>& list = offsets ? offsets_ : tensor_.shape;
    if (list.size() == (offsets ? 2 : kMaxDimensions)) {
      Refuse("too many numbers in " + field_, offsets ? "two byte offsets" : "at most 16 dimensions");
    }
    list.push_back(value);
    return true;
  }

  bool string(string_t& value) override {
    if (place_ == Place::kMetadata) {
      header_->metadata.emplace(field_, value);
      return true;
    }
    if (place_ != Place::kTensor || field_ != "dtype") return Unexpected("the text '" + value + "'");
    const std::optional<SafeType> type = ParseSafeType(value);
    if (!type) Refuse("dtype '" + value + "'", "one of BOOL U8 I8 U16 I16 F16 BF16 U32 I32 F32 U64 I64 F64");
    tensor_.type = *type;
    return true;
  }

  bool start_object(size_t) override {
    if (place_ == Place::kStart) {
      place_ = Place::kRoot;
    } else if (place_ == Place::kRoot) {
      place_ = name_ == kMetadataKey ? Place::kMetadata : Place::kTensor;
      fields_.clear();
      tensor_ = {};
      tensor_.name = name_;
      offsets_.clear();
    } else {
      return Unexpected("an object");
    }
    return true;
  }

  bool key(string_t& key) override {
    if (place_ == Place::kRoot) {
      name_ = key;
      if (!names_.insert(key).second) Refuse("a name that occurs twice", "unique names");
      return true;
    }
    field_ = key;
    if (place_ == Place::kTensor && key != "dtype" && key != "shape" && key != "data_offsets") {
      Refuse("the field '" + key + "'", "dtype, shape and data_offsets");
    }
    if (!fields_.insert(key).second) Refuse("the field '" + key + "' twice", "each field once");
    return true;
  }

  bool end_object() override {
    if (place_ == Place::kTensor) FinishTensor();
    place_ = place_ == Place::kRoot ? Place::kEnd : Place::kRoot;
    return true;
  }

  bool start_array(size_t) override {
    if (place_ != Place::kTensor || field_ == "dtype") return Unexpected("a list");
    place_ = Place::kList;
    return true;
  }
  bool end_array() override {
    place_ = Place::kTensor;
    return true;
  }

  bool parse_error(size_t position, const std::string&, const nlohmann::json::exception& error) override {
    throw Error({path_, "", "a header that is not JSON at byte " + std::to_string(8 + position) + ": " + error.what(),
                 "a safetensors file", ""});
  }

 private:
  enum class Place { kStart, kRoot, kMetadata, kTensor, kList, kEnd };

  [[noreturn]] void Refuse(const std::string& found, const std::string& expected) const {
    throw Error({path_, name_, found, expected, "write the file again with a safetensors library"});
  }

  bool Unexpected(const std::string& what) const {
    const char* expected = "an object";
    if (place_ == Place::kMetadata) expected = "texts only";
    if (place_ == Place::kTensor) expected = "a dtype text and two lists";
    if (place_ == Place::kList) expected = "whole numbers from 0 to 2^64 - 1";
    Refuse(what, expected);
  }

  void FinishTensor() {
    if (fields_.size() != 3) Refuse(std::to_string(fields_.size()) + " fields", "dtype, shape and data_offsets");
    if (offsets_.size() != 2) Refuse(std::to_string(offsets_.size()) + " data_offsets", "two byte offsets");
    const std::optional<uint64_t> size = CheckedSize(tensor_.type, tensor_.shape);
    const std::string what = std::string(SafeTypeName(tensor_.type)) + " " + ShapeText(tensor_.shape);
    if (!size) Refuse(what, "a size that fits in 64 bits");
    tensor_.begin = offsets_.front();
    tensor_.end = offsets_.back();
    if (tensor_.end < tensor_.begin || tensor_.end - tensor_.begin != *size) {
      Refuse("bytes " + std::to_string(tensor_.begin) + " to " + std::to_string(tensor_.end),
             std::to_string(*size) + " bytes for " + what);
    }
    header_->tensors.push_back(std::move(tensor_));
  }

  const std::filesystem::path& path_;
  Header* header_;
  Place place_ = Place::kStart;
  std::string name_, field_;
  std::set<std::string> names_, fields_;
  HeaderTensor tensor_{};
  std::vector<uint64_t> offsets_;
};

}  // namespace

std::optional<uint64_t> CheckedSize(SafeType type, const Shape& shape) {
  // Every partial product is checked, so a wrapped one behind a zero dimension is refused as well.
  uint64_t size = SafeTypeSize(type);
  for (const uint64_t extent : shape) {
    if (extent != 0 && size > UINT64_MAX / extent) return std::nullopt;
    size *= extent;
  }
  return size;
}

Header ParseHeader(const std::filesystem::path& path, std::string_view json) {
  if (json.empty() || json.front() != '{') throw Error({path, "", "a header without '{'", "a safetensors file", ""});
  // The parser takes a zero byte for the end of its input and would pass what hides behind it.
  if (json.find('\0') != std::string_view::npos) throw Error({path, "", "a zero byte in the header", "JSON", ""});
  Header header;
  Handler handler(path, &header);
  nlohmann::json::sax_parse(json.begin(), json.end(), &handler);
  return header;
}

}  // namespace dcloth::converter
