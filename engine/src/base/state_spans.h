// The floats that a saved state holds, as matrices in the cloth's memory, in their order.
#ifndef DCLOTH_ENGINE_SRC_BASE_STATE_SPANS_H_
#define DCLOTH_ENGINE_SRC_BASE_STATE_SPANS_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::engine {

// Gates keep |h| below 1 but for rounding; 8 steps of a float are more than any motion was seen to need.
constexpr float kLargestHidden = 1 + 0x1p-20f;
// Of everything else. Poses end at 1e9, units and bind poses may add as much again; products of such numbers with
// weights do not overflow.
constexpr float kLargestSaved = 1e18f;

// In a saved state the rows follow each other.
struct StateSpan {
  const char* name;
  float* data;                   // null where what is saved is of no use to the cloth
  size_t rows, columns, stride;  // floats from row to row
  float largest;                 // magnitude allowed
};

struct StateSpans {
  static constexpr uint32_t kMost = 24;

  StateSpan spans[kMost];
  uint32_t count = 0;

  // Nothing is added where there are no elements.
  void Add(const char* name, float* data, size_t rows, size_t columns, size_t stride, float largest) {
    if (rows == 0 || columns == 0) return;
    const bool whole = stride == columns;
    spans[count++] = whole ? StateSpan{name, data, 1, rows * columns, rows * columns, largest}
                           : StateSpan{name, data, rows, columns, stride, largest};
  }
  void AddRow(const char* name, float* data, size_t elements) { Add(name, data, 1, elements, elements, kLargestSaved); }

  size_t Floats() const {
    size_t floats = 0;
    for (uint32_t i = 0; i < count; ++i) floats += spans[i].rows * spans[i].columns;
    return floats;
  }
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BASE_STATE_SPANS_H_
