#include "engine/src/contact/touch_lists.h"

#include "kernels/nearest/nearest_order.h"

namespace dcloth::engine {
namespace {

using format::BodyView;
using format::kMaxTouchClasses;
using kernels::kNearestGroup;

static_assert(kMaxTouchClasses == kernels::kTouchClasses);
constexpr size_t kMasks = size_t{1} << kMaxTouchClasses;  // of classes that touch a vertex

size_t Groups(size_t sites) { return (sites + kNearestGroup - 1) / kNearestGroup; }

bool Has(size_t mask, size_t index) { return (mask >> index & 1u) != 0; }

// The groups that each mask has; what nothing touches is in none.
struct GroupCounts {
  explicit GroupCounts(const BodyView& body) {
    for (size_t i = 0; i < body.vertex_count; ++i) ++of[body.touched_by[i]];
    of[0] = 0;
    for (uint32_t& count : of) count = static_cast<uint32_t>(Groups(count));
  }
  size_t All() const {
    size_t sum = 0;
    for (const uint32_t count : of) sum += count;
    return sum;
  }
  size_t TouchedBy(size_t index) const {
    size_t sum = 0;
    for (size_t mask = 0; mask < kMasks; ++mask) sum += Has(mask, index) ? of[mask] : 0;
    return sum;
  }

  uint32_t of[kMasks] = {};
};

// The groups that class `index` touches; returns their end.
uint32_t AppendGroups(const GroupCounts& counts, size_t index, uint16_t* groups, uint32_t end) {
  size_t group = 0;
  for (size_t mask = 0; mask < kMasks; ++mask) {
    for (size_t i = 0; i < counts.of[mask]; ++i, ++group) {
      if (Has(mask, index)) groups[end++] = static_cast<uint16_t>(group);
    }
  }
  return end;
}

}  // namespace

TouchLists PlaceTouchLists(const format::ModelView& model, Arena* arena) {
  const BodyView& body = model.body;
  TouchLists lists = {};
  if (body.garment_order == nullptr) lists.made_order = arena->Take<uint16_t>(model.vertex_count);
  lists.order = body.garment_order != nullptr ? body.garment_order : lists.made_order;
  if (body.touch_classes == nullptr) return lists;
  const GroupCounts counts(body);
  size_t groups = 0;
  for (size_t c = 0; c < kMaxTouchClasses; ++c) groups += counts.TouchedBy(c);
  if (body.sites == nullptr) lists.made_sites = arena->Take<uint16_t>(counts.All() * kNearestGroup);
  lists.sites = body.sites != nullptr ? body.sites : lists.made_sites;
  lists.groups = arena->Take<uint16_t>(groups);
  lists.order_starts = arena->Take<uint32_t>(kMaxTouchClasses + 1);
  lists.group_starts = arena->Take<uint32_t>(kMaxTouchClasses + 1);
  return lists;
}

void FillTouchLists(const format::ModelView& model, const TouchLists& lists) {
  const BodyView& body = model.body;
  const size_t n = model.vertex_count;
  if (lists.made_order != nullptr)
    kernels::OrderPoints(model.template_positions, body.touch_classes, n, lists.made_order);
  if (body.touch_classes == nullptr) return;
  if (lists.made_sites != nullptr)
    kernels::OrderSites(body.positions, body.touched_by, body.vertex_count, lists.made_sites);
  const GroupCounts counts(body);
  for (size_t c = 0; c <= kMaxTouchClasses; ++c) lists.order_starts[c] = 0;
  for (size_t i = 0; i < n; ++i) ++lists.order_starts[body.touch_classes[i] + 1];
  lists.group_starts[0] = 0;
  for (size_t c = 0; c < kMaxTouchClasses; ++c) {
    lists.order_starts[c + 1] += lists.order_starts[c];
    lists.group_starts[c + 1] = AppendGroups(counts, c, lists.groups, lists.group_starts[c]);
  }
}

size_t SiteGroupCount(const BodyView& body) {
  return body.touch_classes == nullptr ? Groups(body.vertex_count) : GroupCounts(body).All();
}

size_t MostGroupCount(const BodyView& body) {
  if (body.touch_classes == nullptr) return Groups(body.vertex_count);
  const GroupCounts counts(body);
  size_t most = 0;
  for (size_t c = 0; c < kMaxTouchClasses; ++c) {
    const size_t count = counts.TouchedBy(c);
    most = count > most ? count : most;
  }
  return most;
}

size_t ClassCount(const format::ModelView& model) { return model.body.touch_classes == nullptr ? 1 : kMaxTouchClasses; }

TouchClass ClassAt(const format::ModelView& model, const TouchLists& lists, size_t index) {
  const BodyView& body = model.body;
  if (body.touch_classes == nullptr) return {lists.order, nullptr, model.vertex_count, Groups(body.vertex_count), 0};
  const uint32_t *points = lists.order_starts + index, *groups = lists.group_starts + index;
  return {lists.order + points[0], lists.groups + groups[0], points[1] - points[0], groups[1] - groups[0],
          static_cast<uint8_t>(1u << index)};
}

}  // namespace dcloth::engine
