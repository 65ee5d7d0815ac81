// What the continuation of a cloth depends on, and nothing else: the floats that a saved state holds, in their order.
//
// How many there are follows from the model and the position in time alone. Not among them: what a tick makes before it
// reads, integers of int8 products (made anew from their input), padding. Rejected: to finish a tick in work before
// saving, which draws other frames than the cloth that goes on, and to begin it anew, for which its start is gone.
#ifndef DCLOTH_ENGINE_SRC_STATE_STATE_LAYOUT_H_
#define DCLOTH_ENGINE_SRC_STATE_STATE_LAYOUT_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/cloth.h"

namespace dcloth::engine {

// Gates keep |h| below 1 but for rounding; 8 steps of a float are more than any motion was seen to need.
constexpr float kLargestHidden = 1 + 0x1p-20f;
// Of everything else. Poses end at 1e9, units and bind poses may add as much again; products of such numbers with
// weights do not overflow.
constexpr float kLargestFloat = 1e18f;

struct StatePosition {
  uint32_t tick_count;  // 0 to kTickSlots; with 0 there are no floats
  TickPlan plan;
  TickPart part;
  uint32_t items_done;
  uint64_t idle_floats;  // of Cloth::idle_start, of this model or another one
};

// A matrix of floats in the cloth's memory; in a saved state its rows follow each other.
struct StateSpan {
  const char* name;
  float* data;                   // null where what is saved is of no use to the cloth
  size_t rows, columns, stride;  // floats from row to row
  float largest;                 // magnitude allowed
};

struct StateSpans {
  static constexpr uint32_t kMost = 22;  // features, h, 8 layers, Q, idle start, 2 a slot, up to 3 of a tick in work

  StateSpan spans[kMost];
  uint32_t count = 0;

  // Nothing is added where there are no elements.
  void Add(const char* name, float* data, size_t rows, size_t columns, size_t stride, float largest);
  size_t Floats() const;
};

// `position` is one that a tick of the model can have.
void ListStateSpans(const Cloth& cloth, const StatePosition& position, StateSpans* spans);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_STATE_STATE_LAYOUT_H_
