// On which side of each limb cloth is, by where it was in the last frame.
#include <cmath>

#include "engine/src/contact/steps.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr float kCloseToBone = 0.05f;  // metres: corners of a triangle that a bone may go through
constexpr float kMargin = 0.02f;       // metres around a core: what a way past it may bend by

struct Ball {
  Vecf middle;
  float radius;
};

// Around what Place(vertex) gives for the vertices of a patch.
template <typename Place>
Ball BallAround(const uint16_t* vertices, size_t count, Place place) {
  Vecf low = place(vertices[0]), high = low;
  for (size_t i = 1; i < count; ++i) {
    const Vecf p = place(vertices[i]);
    low = {p.x < low.x ? p.x : low.x, p.y < low.y ? p.y : low.y, p.z < low.z ? p.z : low.z};
    high = {p.x > high.x ? p.x : high.x, p.y > high.y ? p.y : high.y, p.z > high.z ? p.z : high.z};
  }
  const Vecf across = high - low;
  return {0.5f * (low + high), 0.5f * std::sqrt(Dot(across, across))};
}

float SquaredFromBone(const LimbCore& core, Vecf p) {
  const Vecf away = {p.x, p.y, p.z - NearestOnBone(core, p)};
  return Dot(away, away);
}

bool IsWithin(const LimbCore& core, Vecf p, float distance) { return SquaredFromBone(core, p) < distance * distance; }

// Whether a ball that goes straight from a to b may meet the core.
bool MayMeet(const LimbCore& core, Vecf a, Vecf b, float radius) {
  const Vecf half = 0.5f * (b - a);
  return IsWithin(core, a + half, core.widest + kMargin + radius + std::sqrt(Dot(half, half)));
}

// Whether the bone goes through the triangle, all in its frame.
bool GoesThrough(const LimbCore& core, Vecf a, Vecf b, Vecf c) {
  const float ab = a.x * b.y - a.y * b.x, bc = b.x * c.y - b.y * c.x, ca = c.x * a.y - c.y * a.x;
  if (!((ab >= 0 && bc >= 0 && ca >= 0) || (ab <= 0 && bc <= 0 && ca <= 0))) return false;
  const float sum = ab + bc + ca;
  const float z = (a.z * bc + b.z * ca + c.z * ab) / sum;
  return z > 0 && z < core.length;
}

template <typename Visit>
void VisitPatches(const ModelView& model, const ContactMemory& memory, Visit visit) {
  for (size_t c = 0; c < ClassCount(model); ++c) {
    const TouchClass touch = ClassAt(model, memory.touch, c);
    for (size_t begin = 0; begin < touch.vertex_count; begin += kPatch) {
      const size_t count = touch.vertex_count - begin < kPatch ? touch.vertex_count - begin : kPatch;
      visit(touch.vertices + begin, count, touch.bit);
    }
  }
}

bool Touches(const LimbCore& core, uint8_t bit) { return bit == 0 || (core.touched_by & bit) != 0; }

}  // namespace

uint32_t FindPiercedLimbs(const ModelView& model, const ContactMemory& memory) {
  const uint32_t count = *memory.limbs.count;
  for (size_t v = 0; v < model.vertex_count; ++v) memory.close[v] = 0;
  VisitPatches(model, memory, [&](const uint16_t* vertices, size_t size, uint8_t bit) {
    const Ball target = BallAround(vertices, size, [&](size_t v) { return memory.places[v]; });
    const Ball carried = BallAround(vertices, size, [&](size_t v) { return memory.places[v] + memory.offsets[v]; });
    const Ball was = BallAround(vertices, size, [&](size_t v) { return FromKept(memory.kept.places + 3 * v); });
    NearCores* near = memory.near + memory.patches[vertices[0]];
    *near = {};
    for (uint32_t k = 0; k < count; ++k) {
      const LimbCore& core = memory.limbs.cores[k];
      if (!Touches(core, bit)) continue;
      const Vecf to = core.now.Into(carried.middle), from = core.before.Into(was.middle);
      if (MayMeet(core, from, to, was.radius > carried.radius ? was.radius : carried.radius)) near->met |= 1u << k;
      if (IsWithin(core, to, carried.radius + core.widest + kBeside)) near->beside |= 1u << k;
      if (!IsWithin(core, core.now.Into(target.middle), target.radius + kCloseToBone)) continue;
      for (size_t i = 0; i < size; ++i) {
        const Vecf p = core.now.Into(memory.places[vertices[i]]);
        if (IsWithin(core, p, kCloseToBone)) memory.close[vertices[i]] |= 1u << k;
      }
    }
  });
  uint32_t pierced = 0;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    uint32_t close = memory.close[face[0]] & memory.close[face[1]] & memory.close[face[2]];
    for (uint32_t k = 0; close != 0; ++k, close >>= 1) {
      const LimbCore& core = memory.limbs.cores[k];
      if ((close & 1u) == 0 || (pierced >> core.limb & 1u) != 0) continue;
      Vecf at[3];
      for (int i = 0; i < 3; ++i) at[i] = core.now.Into(memory.places[face[i]]);
      if (GoesThrough(core, at[0], at[1], at[2])) pierced |= 1u << core.limb;
    }
  }
  return pierced;
}

void KeepSides(const ModelView& model, const ContactMemory& memory, uint32_t pierced) {
  VisitPatches(model, memory, [&](const uint16_t* vertices, size_t size, uint8_t) {
    const uint32_t near = memory.near[memory.patches[vertices[0]]].met;
    for (uint32_t k = 0; near >> k != 0; ++k) {
      if ((near >> k & 1u) == 0) continue;
      const LimbCore& core = memory.limbs.cores[k];
      const bool is_pierced = (pierced >> core.limb & 1u) != 0;
      for (size_t i = 0; i < size; ++i) {
        const size_t v = vertices[i];
        const Vecf target = memory.places[v], from = core.before.Into(FromKept(memory.kept.places + 3 * v));
        Vecf to = core.now.Into(target + memory.offsets[v]), normal;
        if (!MayMeet(core, from, to, 0)) continue;
        bool met = false;
        const Vecf goal = core.now.Into(target);
        if (is_pierced) {
          if (memory.active[v] != 0 && LeadsThrough(core, from, goal)) {
            to = from;
            met = true;
            memory.holds[v] = Hold::kHeld;
          }
          met |= Slide(core, from, &to);
        } else {
          if (memory.active[v] != 0 && LeadsThrough(core, to, goal)) {
            to = goal;
            met = true;
          }
          met |= LeaveCore(core, &to, &normal) > 0;
        }
        if (!met) continue;
        memory.offsets[v] = OutOf(core, to) - target;
        if (memory.holds[v] == Hold::kFree) memory.holds[v] = Hold::kMet;
      }
    }
  });
}

}  // namespace dcloth::engine
