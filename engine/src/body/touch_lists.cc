#include "engine/src/body/touch_lists.h"

#include "engine/src/body/patch_order.h"
#include "kernels/nearest/nearest.h"

namespace dcloth::engine {
namespace {

using format::BodyView;
using format::kMaxTouchClasses;
using kernels::kNearestGroup;

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

// Numbers from 0 to count - 1 that `belongs`; returns their end.
template <typename Belongs>
uint32_t Append(size_t count, Belongs belongs, uint16_t* list, uint32_t end) {
  for (size_t i = 0; i < count; ++i) {
    if (belongs(i)) list[end++] = static_cast<uint16_t>(i);
  }
  return end;
}

void FillSites(const BodyView& body, const GroupCounts& counts, uint16_t* sites) {
  for (size_t mask = 1; mask < kMasks; ++mask) {
    if (counts.of[mask] == 0) continue;
    const uint32_t end = Append(body.vertex_count, [&](size_t i) { return body.touched_by[i] == mask; }, sites, 0);
    OrderByPlace(body.positions, sites, end);
    for (size_t i = end; i < counts.of[mask] * kNearestGroup; ++i) sites[i] = sites[end - 1];
    sites += counts.of[mask] * kNearestGroup;
  }
}

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
  TouchLists lists = {};
  lists.order = arena->Take<uint16_t>(model.vertex_count);
  if (model.body.touch_classes == nullptr) return lists;
  const GroupCounts counts(model.body);
  size_t groups = 0;
  for (size_t c = 0; c < kMaxTouchClasses; ++c) groups += counts.TouchedBy(c);
  lists.sites = arena->Take<uint16_t>(counts.All() * kNearestGroup);
  lists.groups = arena->Take<uint16_t>(groups);
  lists.order_starts = arena->Take<uint32_t>(kMaxTouchClasses + 1);
  lists.group_starts = arena->Take<uint32_t>(kMaxTouchClasses + 1);
  return lists;
}

void FillTouchLists(const format::ModelView& model, const TouchLists& lists) {
  const BodyView& body = model.body;
  const size_t n = model.vertex_count;
  if (body.touch_classes == nullptr) {
    const uint32_t end = Append(n, [](size_t) { return true; }, lists.order, 0);
    OrderByPlace(model.template_positions, lists.order, end);
    return;
  }
  const GroupCounts counts(body);
  FillSites(body, counts, lists.sites);
  uint32_t order_end = 0, group_end = 0;
  for (size_t c = 0; c < kMaxTouchClasses; ++c) {
    const uint32_t begin = lists.order_starts[c] = order_end;
    lists.group_starts[c] = group_end;
    order_end = Append(n, [&](size_t i) { return body.touch_classes[i] == c; }, lists.order, order_end);
    group_end = AppendGroups(counts, c, lists.groups, group_end);
    OrderByPlace(model.template_positions, lists.order + begin, order_end - begin);
  }
  lists.order_starts[kMaxTouchClasses] = order_end;
  lists.group_starts[kMaxTouchClasses] = group_end;
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
