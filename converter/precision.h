// How a model's large tensors are stored.
#ifndef DCLOTH_CONVERTER_PRECISION_H_
#define DCLOTH_CONVERTER_PRECISION_H_

#include <array>
#include <optional>
#include <string_view>

namespace dcloth::converter {

enum class Precision { kFp32, kFp16, kInt8 };

constexpr std::array<Precision, 3> kPrecisions = {Precision::kFp32, Precision::kFp16, Precision::kInt8};

constexpr const char* PrecisionName(Precision precision) {
  return precision == Precision::kFp32 ? "fp32" : precision == Precision::kFp16 ? "fp16" : "int8";
}

// "fp32", "fp16", "int8"; empty for anything else ("auto" is no precision).
constexpr std::optional<Precision> ParsePrecision(std::string_view name) {
  for (const Precision precision : kPrecisions) {
    if (name == PrecisionName(precision)) return precision;
  }
  return std::nullopt;
}

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_PRECISION_H_
