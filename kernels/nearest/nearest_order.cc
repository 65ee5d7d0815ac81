#include "kernels/nearest/nearest_order.h"

#include <cstring>

namespace dcloth::kernels {
namespace {

constexpr size_t kMasks = size_t{1} << kTouchClasses;
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
  constexpr size_t kPatch = kNearestPatch;
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

size_t GroupsOf(size_t vertices) { return (vertices + kNearestGroup - 1) / kNearestGroup; }

// Numbers whose `values` are `value`, all of them where that is null and `value` 0; returns their end.
size_t Append(const uint8_t* values, uint8_t value, size_t count, uint16_t* list, size_t end) {
  for (size_t i = 0; i < count; ++i) {
    if (values == nullptr ? value == 0 : values[i] == value) list[end++] = static_cast<uint16_t>(i);
  }
  return end;
}

}  // namespace

void OrderByPlace(const float* positions, uint16_t* vertices, size_t count) {
  Order(positions, vertices, vertices + count);
}

void OrderPoints(const float* positions, const uint8_t* classes, size_t count, uint16_t* order) {
  size_t begin = 0;
  for (size_t c = 0; c < kTouchClasses; ++c) {
    const size_t end = Append(classes, static_cast<uint8_t>(c), count, order, begin);
    OrderByPlace(positions, order + begin, end - begin);
    begin = end;
  }
}

size_t CountSiteGroups(const uint8_t* touched_by, size_t count) {
  uint32_t vertices[kMasks] = {};
  for (size_t i = 0; i < count; ++i) ++vertices[touched_by[i]];
  size_t groups = 0;
  for (size_t mask = 1; mask < kMasks; ++mask) groups += GroupsOf(vertices[mask]);
  return groups;
}

void OrderSites(const float* positions, const uint8_t* touched_by, size_t count, uint16_t* sites) {
  for (size_t mask = 1; mask < kMasks; ++mask) {
    const size_t end = Append(touched_by, static_cast<uint8_t>(mask), count, sites, 0);
    if (end == 0) continue;
    OrderByPlace(positions, sites, end);
    const size_t filled = GroupsOf(end) * kNearestGroup;
    for (size_t i = end; i < filled; ++i) sites[i] = sites[end - 1];
    sites += filled;
  }
}

}  // namespace dcloth::kernels
