// Which vertices of the garment touch which of the body (dcloth.fbs, Body), as lists by class. Where a model says
// nothing there is one class: every vertex touches all of the body.
#ifndef DCLOTH_ENGINE_SRC_TOUCH_LISTS_H_
#define DCLOTH_ENGINE_SRC_TOUCH_LISTS_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/arena.h"

namespace dcloth::engine {

struct TouchLists {
  uint16_t* order;           // [n] the garment's vertices by class, within a class neighbours together
  uint16_t* touched;         // body vertices by class that touches them; null without classes, as the next two
  uint32_t* order_starts;    // [kMaxTouchClasses + 1] into `order`
  uint32_t* touched_starts;  // [kMaxTouchClasses + 1] into `touched`
};

// The vertices of one class, and what they touch.
struct TouchClass {
  const uint16_t* vertices;  // of the garment
  const uint16_t* touched;   // of the body; null for all of them in order
  size_t vertex_count;
  size_t touched_count;
  uint8_t bit;  // in format::BodyView::touched_by
};

// The model has a body.
TouchLists PlaceTouchLists(const format::ModelView& model, Arena* arena);

// Once, before the first ClassAt.
void FillTouchLists(const format::ModelView& model, const TouchLists& lists);

size_t ClassCount(const format::ModelView& model);
TouchClass ClassAt(const format::ModelView& model, const TouchLists& lists, size_t index);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_TOUCH_LISTS_H_
