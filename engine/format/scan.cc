#include "engine/format/scan.h"

namespace dcloth::format {
namespace {

constexpr float kLargestFloat = 3.402823466e38f;
constexpr float kSmallestNormal = 1.17549435e-38f;

// Blocks first without an early exit, then the offender inside the first bad block.
template <typename Bad>
size_t FindFirst(size_t count, Bad bad) {
  constexpr size_t kBlock = 256;
  for (size_t begin = 0; begin < count; begin += kBlock) {
    const size_t end = begin + kBlock < count ? begin + kBlock : count;
    unsigned any = 0;
    for (size_t i = begin; i < end; ++i) any |= static_cast<unsigned>(bad(i));
    if (any == 0) continue;
    for (size_t i = begin; i < end; ++i) {
      if (bad(i)) return i;
    }
  }
  return count;
}

template <typename T>
size_t FindIndexNotBelow(const T* values, size_t count, uint32_t limit) {
  if (limit > static_cast<T>(~T{0})) return count;
  const auto bound = static_cast<T>(limit);
  return FindFirst(count, [=](size_t i) { return values[i] >= bound; });
}

}  // namespace

size_t FindNotFinite(const float* values, size_t count) {
  return FindFirst(count, [=](size_t i) { return !(values[i] >= -kLargestFloat && values[i] <= kLargestFloat); });
}

size_t FindNotPositive(const float* values, size_t count) {
  return FindFirst(count, [=](size_t i) { return !(values[i] >= kSmallestNormal && values[i] <= kLargestFloat); });
}

size_t FindNotBelow(const uint8_t* values, size_t count, uint32_t limit) { return FindIndexNotBelow(values, count, limit); }
size_t FindNotBelow(const uint16_t* values, size_t count, uint32_t limit) { return FindIndexNotBelow(values, count, limit); }

size_t FindBadWeightRow(const float* weights, size_t rows, size_t width) {
  return FindFirst(rows, [=](size_t row) {
    float sum = 0.0f;
    unsigned negative = 0;
    for (size_t k = 0; k < width; ++k) {
      const float weight = weights[row * width + k];
      negative |= static_cast<unsigned>(!(weight >= 0.0f));
      sum += weight;
    }
    return negative != 0 || !(sum >= 1.0f - kWeightSumTolerance && sum <= 1.0f + kWeightSumTolerance);
  });
}

size_t FindNotRising(const uint32_t* starts, size_t count) {
  return FindFirst(count, [=](size_t i) { return starts[i] >= starts[i + 1]; });
}

}  // namespace dcloth::format
