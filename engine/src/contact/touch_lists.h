// Which vertices of the garment touch which of the body (dcloth.fbs, Body), as lists by class. Where a model says
// nothing there is one class: every vertex touches all of the body.
#ifndef DCLOTH_ENGINE_SRC_CONTACT_TOUCH_LISTS_H_
#define DCLOTH_ENGINE_SRC_CONTACT_TOUCH_LISTS_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/base/lent_memory.h"

namespace dcloth::engine {

struct TouchLists {
  const uint16_t* order;   // [n] the garment's vertices by class, within a class neighbours together
  const uint16_t* sites;   // [groups, kernels::kNearestGroup] body vertices, those of a group neighbours that the same
                           // classes touch, filled up with its last; null without classes, as the next three
  uint16_t* groups;        // by class that touches them
  uint32_t* order_starts;  // [kMaxTouchClasses + 1] into `order`
  uint32_t* group_starts;  // [kMaxTouchClasses + 1] into `groups`
  uint16_t* made_order;    // `order` and `sites` where the file, before format 1.5, has none; else null
  uint16_t* made_sites;
};

// The vertices of one class, and what they touch.
struct TouchClass {
  const uint16_t* vertices;  // of the garment
  const uint16_t* groups;    // of sites; null for all of them in order
  size_t vertex_count;
  size_t group_count;
  uint8_t bit;  // in format::BodyView::touched_by
};

// The model has a body.
TouchLists PlaceTouchLists(const format::ModelView& model, Arena* arena);

// Once, before the first ClassAt. Cost: a millisecond for 8,000 vertices where the file has no order, else
// microseconds.
void FillTouchLists(const format::ModelView& model, const TouchLists& lists);

// Groups of sites, those of all classes together and of the class that touches most.
size_t SiteGroupCount(const format::BodyView& body);
size_t MostGroupCount(const format::BodyView& body);

// The body vertex at a site: groups follow each other, and the last vertex fills up the last one.
inline size_t BodyVertexAt(const format::BodyView& body, const TouchLists& lists, size_t site) {
  if (lists.sites != nullptr) return lists.sites[site];
  return site < body.vertex_count ? site : body.vertex_count - 1;
}

size_t ClassCount(const format::ModelView& model);
TouchClass ClassAt(const format::ModelView& model, const TouchLists& lists, size_t index);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CONTACT_TOUCH_LISTS_H_
