// Cloth around what a limb moved gives way.
#include <cmath>

#include "engine/src/contact/steps.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr float kMoveARing = 0.4f;  // of an edge: a vertex that is moved so far takes one more ring along
constexpr int kMostRings = 18;
constexpr int kSweeps = 3;  // a frame goes on from the last one's offsets
constexpr float kOverRelaxation = 1.4f;
constexpr float kScreening = 0.05f;       // draws offsets to zero: that many more neighbours without one
constexpr float kMostStretch = 1.2f;      // of its length when bound
constexpr float kMostShortening = 0.02f;  // metres a sweep

float Length(Vecf v) { return std::sqrt(Dot(v, v)); }

// Beside which cores the listed vertices are, and where in their frames.
size_t FindTouches(const ContactMemory& memory, size_t count) {
  size_t touches = 0;
  for (size_t i = 0; i < count; ++i) {
    const uint16_t v = memory.list[i];
    if (memory.holds[v] == Hold::kFixed) continue;
    const uint32_t near = memory.near[memory.patches[v]].beside;
    const Vecf place = memory.places[v] + memory.offsets[v];
    for (uint32_t k = 0; near >> k != 0 && touches < kMostTouches; ++k) {
      if ((near >> k & 1u) == 0) continue;
      const LimbCore& core = memory.limbs.cores[k];
      const Vecf p = core.now.Into(place);
      const Vecf away = {p.x, p.y, p.z - NearestOnBone(core, p)};
      const float reach = core.widest + kBeside;
      if (Dot(away, away) < reach * reach) memory.touches[touches++] = {p, v, static_cast<uint8_t>(k)};
    }
  }
  return touches;
}

void Smooth(const ContactMemory& memory, size_t v) {
  const uint32_t begin = memory.beside_starts[v], end = memory.beside_starts[v + 1];
  Vecf sum = {0, 0, 0};
  for (uint32_t j = begin; j < end; ++j) sum = sum + memory.offsets[memory.beside[j]];
  const Vecf mean = (1 / (static_cast<float>(end - begin) + kScreening)) * sum;
  memory.offsets[v] = memory.offsets[v] + kOverRelaxation * (mean - memory.offsets[v]);
}

void Shorten(const ModelView& model, const ContactMemory& memory, size_t v) {
  const float share = memory.holds[v] == Hold::kFixed ? 0.0f : 1.0f;
  for (uint32_t j = memory.beside_starts[v]; j < memory.beside_starts[v + 1]; ++j) {
    const size_t u = memory.beside[j];
    if (memory.active[u] != 0 && u < v) continue;
    const Vecf way = memory.places[u] + memory.offsets[u] - memory.places[v] - memory.offsets[v];
    const Vecf bound = VecfAt(model.template_positions + 3 * u) - VecfAt(model.template_positions + 3 * v);
    const float squared = Dot(way, way), allowed = kMostStretch * kMostStretch * Dot(bound, bound);
    if (!(squared > allowed)) continue;
    const float other = memory.active[u] != 0 && memory.holds[u] != Hold::kFixed ? 1.0f : 0.0f;
    if (share + other == 0) continue;
    const float length = std::sqrt(squared), over = length - std::sqrt(allowed);
    const float part = (over < kMostShortening ? over : kMostShortening) / (length * (share + other));
    memory.offsets[v] = memory.offsets[v] + (part * share) * way;
    memory.offsets[u] = memory.offsets[u] - (part * other) * way;
  }
}

}  // namespace

size_t ListActive(const ModelView& model, const ContactMemory& memory) {
  // Rings that each vertex asks for, sorted by counting.
  uint32_t starts[kMostRings + 2] = {};
  const size_t n = model.vertex_count;
  const float move_a_ring = kMoveARing * *memory.mean_edge;
  for (size_t v = 0; v < n; ++v) {
    int rings = 0;
    if (memory.active[v] != 0 || memory.holds[v] != Hold::kFree) {
      const float moved = Length(memory.offsets[v]) / move_a_ring;
      rings = moved < kMostRings - 1 ? 1 + static_cast<int>(moved) : kMostRings;
    }
    memory.rings[v] = static_cast<uint8_t>(rings);
    memory.active[v] = 0;
    ++starts[kMostRings - rings + 1];
  }
  for (int r = 0; r <= kMostRings; ++r) starts[r + 1] += starts[r];
  uint32_t ends[kMostRings + 1];
  for (int r = 0; r <= kMostRings; ++r) ends[r] = starts[r];
  for (size_t v = 0; v < n; ++v) memory.sorted[ends[kMostRings - memory.rings[v]]++] = static_cast<uint16_t>(v);
  size_t count = 0, ring = 0;
  const auto take = [&](size_t v) {
    if (memory.active[v] != 0 || count == kMostActive) return;
    memory.active[v] = 1;
    memory.list[count++] = static_cast<uint16_t>(v);
  };
  for (int r = 0; r < kMostRings; ++r) {
    for (uint32_t i = starts[r]; i < starts[r + 1]; ++i) take(memory.sorted[i]);
    const size_t end = count;
    for (; ring < end && r + 1 < kMostRings; ++ring) {
      const size_t v = memory.list[ring];
      for (uint32_t j = memory.beside_starts[v]; j < memory.beside_starts[v + 1]; ++j) take(memory.beside[j]);
    }
  }
  for (size_t v = 0; v < n; ++v) {
    if (memory.active[v] == 0) memory.offsets[v] = {0, 0, 0};
  }
  for (size_t i = 0; i < count; ++i) {
    const size_t v = memory.list[i];
    if (memory.fixed[v] != 0) memory.holds[v] = Hold::kFixed;
  }
  return count;
}

void GiveWay(const ModelView& model, const ContactMemory& memory, size_t count) {
  const size_t touches = FindTouches(memory, count);
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    const auto listed = [&](size_t i) { return memory.list[sweep % 2 == 0 ? i : count - 1 - i]; };
    for (size_t i = 0; i < count; ++i) {
      const size_t v = listed(i);
      if (memory.holds[v] < Hold::kHeld) Smooth(memory, v);
    }
    for (size_t i = 0; i < count; ++i) Shorten(model, memory, listed(i));
    for (size_t i = 0; i < touches; ++i) {
      Touch& touch = memory.touches[i];
      const LimbCore& core = memory.limbs.cores[touch.core];
      const Vecf target = memory.places[touch.vertex];
      Vecf p = core.now.Into(target + memory.offsets[touch.vertex]);
      if (Slide(core, touch.place, &p)) memory.offsets[touch.vertex] = OutOf(core, p) - target;
      touch.place = p;
    }
  }
}

}  // namespace dcloth::engine
