#include "engine/src/body/patch_order.h"

#include <cstring>

#include "kernels/nearest/nearest.h"

namespace dcloth::engine {
namespace {

constexpr size_t kSmallest = 4;  // lanes of the narrowest vectors

// A float's place in the order of all bit patterns: smaller floats first, NaN at the ends.
uint32_t Key(const float* positions, uint16_t vertex, size_t axis) {
  uint32_t bits;
  std::memcpy(&bits, positions + size_t{3} * vertex + axis, sizeof(bits));
  return bits ^ ((bits & 0x80000000u) != 0 ? 0xFFFFFFFFu : 0x80000000u);
}

size_t LongestSide(const float* positions, const uint16_t* begin, const uint16_t* end) {
  size_t longest = 0;
  float length = -1;
  for (size_t axis = 0; axis < 3; ++axis) {
    float low = positions[size_t{3} * *begin + axis], high = low;
    for (const uint16_t* v = begin; v != end; ++v) {
      const float x = positions[size_t{3} * *v + axis];
      low = x < low ? x : low;
      high = x > high ? x : high;
    }
    if (!(high - low > length)) continue;
    length = high - low;
    longest = axis;
  }
  return longest;
}

// No key before `middle` is larger than one from there on: a radix exchange that only follows the part with `middle`.
void Split(const float* positions, size_t axis, uint16_t* begin, uint16_t* middle, uint16_t* end) {
  const uint32_t first = Key(positions, *begin, axis);
  uint32_t differ = 0;
  for (const uint16_t* v = begin; v != end; ++v) differ |= first ^ Key(positions, *v, axis);
  for (uint32_t bit = 0x80000000u; bit != 0 && begin != middle; bit >>= 1) {
    if ((differ & bit) == 0) continue;
    uint16_t *low = begin, *high = end;
    while (low != high) {
      if ((Key(positions, *low, axis) & bit) == 0) {
        ++low;
        continue;
      }
      --high;
      const uint16_t larger = *low;
      *low = *high;
      *high = larger;
    }
    (low <= middle ? begin : end) = low;
  }
}

// Whole patches on the left of each cut, within a patch a power of two.
size_t Half(size_t count) {
  constexpr size_t kPatch = kernels::kNearestPatch;
  if (count > kPatch) return ((count + kPatch - 1) / kPatch + 1) / 2 * kPatch;
  size_t half = kSmallest;
  while (2 * half < count) half *= 2;
  return half;
}

void Order(const float* positions, uint16_t* begin, uint16_t* end) {
  const auto count = static_cast<size_t>(end - begin);
  if (count <= kSmallest) return;
  uint16_t* const middle = begin + Half(count);
  Split(positions, LongestSide(positions, begin, end), begin, middle, end);
  Order(positions, begin, middle);
  Order(positions, middle, end);
}

}  // namespace

void OrderByPlace(const float* positions, uint16_t* vertices, size_t count) {
  Order(positions, vertices, vertices + count);
}

}  // namespace dcloth::engine
