// Passes over a tensor's elements: branch-free so that compilers vectorise them, since opening a model should cost no
// more than reading its small arrays once. Each returns the index of the first offender, or `count` when there is none.
#ifndef DCLOTH_ENGINE_FORMAT_SCAN_H_
#define DCLOTH_ENGINE_FORMAT_SCAN_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::format {

size_t FindNotFinite(const float* values, size_t count);

// Not finite, or below the smallest normal float (a subnormal's worth would depend on the host's DAZ flag).
size_t FindNotPositive(const float* values, size_t count);

size_t FindBelow(const int8_t* values, size_t count, int8_t limit);
size_t FindNotBelow(const uint8_t* values, size_t count, uint32_t limit);
size_t FindNotBelow(const uint16_t* values, size_t count, uint32_t limit);

// Of values below `limit` one that was there before, other than right before it.
size_t FindRepeated(const uint16_t* values, size_t count, uint32_t limit);

// Rows of `width` weights, 1 to 8, none negative, that sum to 1 within kWeightSumTolerance. Returns a row.
constexpr float kWeightSumTolerance = 1e-4f;  // 8 rounded weights err by less than 1e-6; the rest is for other writers
size_t FindBadWeightRow(const float* weights, size_t rows, size_t width);

// starts[i] < starts[i + 1] for every i below count.
size_t FindNotRising(const uint32_t* starts, size_t count);

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_SCAN_H_
