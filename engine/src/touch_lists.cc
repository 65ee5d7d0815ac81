#include "engine/src/touch_lists.h"

#include "engine/src/patch_order.h"

namespace dcloth::engine {
namespace {

using format::kMaxTouchClasses;

bool Touches(const format::BodyView& body, size_t vertex, size_t index) {
  return (body.touched_by[vertex] >> index & 1u) != 0;
}

size_t TouchedCount(const format::BodyView& body) {
  size_t count = 0;
  for (size_t i = 0; i < body.vertex_count; ++i) {
    for (size_t c = 0; c < kMaxTouchClasses; ++c) count += Touches(body, i, c) ? 1 : 0;
  }
  return count;
}

// Numbers from 0 to count - 1 that `belongs`; returns their end.
template <typename Belongs>
uint32_t Append(size_t count, Belongs belongs, uint16_t* list, uint32_t end) {
  for (size_t i = 0; i < count; ++i) {
    if (belongs(i)) list[end++] = static_cast<uint16_t>(i);
  }
  return end;
}

}  // namespace

TouchLists PlaceTouchLists(const format::ModelView& model, Arena* arena) {
  TouchLists lists = {};
  lists.order = arena->Take<uint16_t>(model.vertex_count);
  if (model.body.touch_classes == nullptr) return lists;
  lists.touched = arena->Take<uint16_t>(TouchedCount(model.body));
  lists.order_starts = arena->Take<uint32_t>(kMaxTouchClasses + 1);
  lists.touched_starts = arena->Take<uint32_t>(kMaxTouchClasses + 1);
  return lists;
}

void FillTouchLists(const format::ModelView& model, const TouchLists& lists) {
  const format::BodyView& body = model.body;
  const size_t n = model.vertex_count;
  if (body.touch_classes == nullptr) {
    const uint32_t end = Append(n, [](size_t) { return true; }, lists.order, 0);
    OrderByPlace(model.template_positions, lists.order, end);
    return;
  }
  uint32_t order_end = 0, touched_end = 0;
  for (size_t c = 0; c < kMaxTouchClasses; ++c) {
    const uint32_t begin = lists.order_starts[c] = order_end;
    lists.touched_starts[c] = touched_end;
    order_end = Append(n, [&](size_t i) { return body.touch_classes[i] == c; }, lists.order, order_end);
    touched_end = Append(body.vertex_count, [&](size_t i) { return Touches(body, i, c); }, lists.touched, touched_end);
    OrderByPlace(model.template_positions, lists.order + begin, order_end - begin);
  }
  lists.order_starts[kMaxTouchClasses] = order_end;
  lists.touched_starts[kMaxTouchClasses] = touched_end;
}

size_t ClassCount(const format::ModelView& model) { return model.body.touch_classes == nullptr ? 1 : kMaxTouchClasses; }

TouchClass ClassAt(const format::ModelView& model, const TouchLists& lists, size_t index) {
  const format::BodyView& body = model.body;
  if (body.touch_classes == nullptr) return {lists.order, nullptr, model.vertex_count, body.vertex_count, 0};
  const uint32_t *points = lists.order_starts + index, *sites = lists.touched_starts + index;
  return {lists.order + points[0], lists.touched + sites[0], points[1] - points[0], sites[1] - sites[0],
          static_cast<uint8_t>(1u << index)};
}

}  // namespace dcloth::engine
