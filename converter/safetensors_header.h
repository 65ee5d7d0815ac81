// The JSON header of a safetensors file, parsed event by event: no document tree, so a hostile header costs no more
// memory than its own tensors, and duplicate keys are seen.
#ifndef DCLOTH_CONVERTER_SAFETENSORS_HEADER_H_
#define DCLOTH_CONVERTER_SAFETENSORS_HEADER_H_

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "converter/safetensors.h"

namespace dcloth::converter {

constexpr uint64_t kMaxHeaderBytes = 100'000'000;  // the reference implementation's limit
constexpr size_t kMaxDimensions = 16;

struct HeaderTensor {
  std::string name;
  SafeType type;
  Shape shape;
  uint64_t begin, end;  // bytes from the start of the data
};

struct Header {
  std::vector<HeaderTensor> tensors;
  Metadata metadata;
};

// Throws Error: syntax, bad UTF-8, unknown or missing fields, duplicates, sizes that do not match shapes. Whether
// ranges tile the data is the caller's question.
Header ParseHeader(const std::filesystem::path& path, std::string_view json);

std::optional<SafeType> ParseSafeType(std::string_view name);

// Bytes of a tensor, empty where the product leaves 64 bits.
std::optional<uint64_t> CheckedSize(SafeType type, const Shape& shape);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_SAFETENSORS_HEADER_H_
