#include "engine/src/body/swept_limbs.h"

#include <cmath>

#include "engine/src/body/limb_turns.h"
#include "engine/src/body/stretched_cloth.h"
#include "engine/src/body/worn_cloth.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr int kMostTries = 5;  // of a frame, and one again
// What is torn, in triangles: the sum over those through a limb of how much nearer to its bone than kDeep they come, in
// shares of the core's radius. So much is a tear; so much of what there was is none.
constexpr float kDeep = 0.7f, kTorn = 0.05f, kLess = 0.25f;
constexpr float kStep = 0.02f;                         // metres: less than a core is thick
constexpr float kMostSteps = 32, kMostFallSteps = 64;  // longer ways take longer steps
constexpr int kRings = 8;                              // around what was pushed, that give way
constexpr int kSpreads = 16, kEasings = 8;
constexpr float kOwn = 0.5f;  // share of a vertex that goes with a limb, from which on it falls onto it
constexpr float kFar = 1e18f;

// What is tried where a limb tore its cloth: the cloth falls onto it from where the limb would wear it, or the limb is
// swept from a share of the turns that take it to where its joints hold it in the bind pose, or both, one after the
// other. After a fall a short sweep does: it takes along what did not meet the limb.
struct Try {
  bool falls;
  float sweeps_from;  // 0: it does not
};
constexpr Try kTries[] = {{true, 0}, {true, 0.02f}, {false, 0.5f}, {true, 0.25f}, {false, 1}};

float TornBy(const ModelView& model, const Limb& limb, const uint32_t* triangles, size_t count, const SweptCloth& swept,
             const Surface& surface) {
  float torn = 0;
  for (size_t t = 0; t < count; ++t) {
    const uint16_t *face = model.faces + size_t{3} * triangles[t], a = face[0], b = face[1], c = face[2];
    if ((swept.limbs[a] & swept.limbs[b] & swept.limbs[c] & limb.bit) == 0) continue;
    const float *p = surface.PositionOf(a), *q = surface.PositionOf(b), *r = surface.PositionOf(c);
    const float middle[3] = {(p[0] + q[0] + r[0]) / 3, (p[1] + q[1] + r[1]) / 3, (p[2] + q[2] + r[2]) / 3};
    for (size_t k = 0; k < limb.count; ++k) {
      float away[3], radius;
      if (!IsInCore(*limb.parts[k], middle, away, &radius)) continue;
      const float deeper = kDeep - std::sqrt(Dot(away, away)) / radius;
      torn += deeper > 0 ? deeper : 0.0f;
    }
  }
  return torn;
}

// Whether a bone of the limb goes through its cloth: a hole through which the limb is seen, however little of it tore.
bool IsPierced(const ModelView& model, const Limb& limb, const uint32_t* triangles, size_t count,
               const SweptCloth& swept, const Surface& surface) {
  for (size_t t = 0; t < count; ++t) {
    const uint16_t *face = model.faces + size_t{3} * triangles[t], a = face[0], b = face[1], c = face[2];
    if ((swept.limbs[a] & swept.limbs[b] & swept.limbs[c] & limb.bit) == 0) continue;
    for (size_t k = 0; k < limb.count; ++k) {
      if (GoesThrough(*limb.parts[k], surface.PositionOf(a), surface.PositionOf(b), surface.PositionOf(c))) return true;
    }
  }
  return false;
}

// Out of a part that has moved, the way that it moved; cloth behind its bone stays, as the part leaves it.
bool Push(const LimbCore& before, const LimbCore& now, float* position) {
  float away[3], radius, way[3];
  if (!IsInCore(now, position, away, &radius)) return false;
  const float along = PlaceOnBone(now.posed_from, now.along, now.inverse_squared, position).along;
  const float share = along < 1 ? along : 1.0f;
  for (size_t c = 0; c < 3; ++c)
    way[c] = now.posed_from[c] - before.posed_from[c] + share * (now.along[c] - before.along[c]);
  if (along < 1) {
    const float lengthwise = Dot(way, now.along) * now.inverse_squared;
    for (size_t c = 0; c < 3; ++c) way[c] -= lengthwise * now.along[c];
  }
  const float length = std::sqrt(Dot(way, way));
  if (!(length > 0) || Dot(way, away) < 0) return false;
  for (float& c : way) c /= length;
  const float ahead = Dot(way, away);
  const float out = std::sqrt(ahead * ahead + radius * radius - Dot(away, away)) - ahead + SkinOver(now, radius);
  for (size_t c = 0; c < 3; ++c) position[c] += out * way[c];
  return true;
}

// Axis-aligned.
struct Box {
  float low[3] = {kFar, kFar, kFar}, high[3] = {-kFar, -kFar, -kFar};
};

void Extend(const LimbCore& part, Box* box) {
  for (size_t c = 0; c < 3; ++c) {
    const float from = part.posed_from[c], to = from + part.along[c];
    const float low = (from < to ? from : to) - part.reach, high = (from < to ? to : from) + part.reach;
    box->low[c] = low < box->low[c] ? low : box->low[c];
    box->high[c] = high > box->high[c] ? high : box->high[c];
  }
}

bool IsInBox(const Box& box, const float* point) {
  bool inside = true;
  for (size_t c = 0; c < 3; ++c) inside &= point[c] >= box.low[c] && point[c] <= box.high[c];
  return inside;
}

float StepsOf(const Limb& limb, const LimbPose& start) {
  float longest = 0;
  for (size_t k = 0; k < limb.count; ++k) {
    const LimbCore &from = start.parts[k], &to = *limb.parts[k];
    float apart[3];
    for (size_t c = 0; c < 3; ++c) apart[c] = from.posed_from[c] + from.along[c] - to.posed_from[c] - to.along[c];
    const float length = std::sqrt(Dot(apart, apart)) / to.scale;
    longest = length > longest ? length : longest;
  }
  const float steps = longest / kStep + 1;
  return steps < kMostSteps ? static_cast<float>(static_cast<int>(steps)) : kMostSteps;
}

// Where a limb is after a step, of the last of which it is as posed.
LimbPose PoseAfter(const Limb& limb, float from, float step, float steps) {
  return PoseAt(limb, (1 - step / steps) * from);
}

// Lists what a limb pushes on its way, after the `found` vertices; returns how many there are then. `scratch` [n].
size_t PushAlong(const ModelView& model, const Limb& limb, float from, const SweptCloth& swept, uint16_t* scratch,
                 size_t found, const Surface& surface) {
  LimbPose before = PoseAt(limb, from);
  const float steps = StepsOf(limb, before);
  Box way;
  for (float step = 0; step <= steps; ++step) {
    const LimbPose pose = PoseAfter(limb, from, step, steps);
    for (size_t k = 0; k < limb.count; ++k) Extend(pose.parts[k], &way);
  }
  size_t near = 0;
  for (size_t v = 0; v < model.vertex_count; ++v) {
    if ((swept.limbs[v] & limb.bit) == 0 || !IsInBox(way, surface.PositionOf(v))) continue;
    scratch[near++] = static_cast<uint16_t>(v);
  }
  for (float step = 1; step <= steps; ++step) {
    const LimbPose now = PoseAfter(limb, from, step, steps);
    Box boxes[kMostParts];
    for (size_t k = 0; k < limb.count; ++k) Extend(now.parts[k], &boxes[k]);
    for (size_t i = 0; i < near; ++i) {
      const uint16_t v = scratch[i];
      float* position = surface.PositionOf(v);
      const float start[3] = {position[0], position[1], position[2]};
      const bool listed = swept.places[v] != kNotDeep;
      if (!listed && found == kMostDeep) continue;
      bool pushed = false;
      for (size_t k = 0; k < limb.count; ++k)
        pushed |= IsInBox(boxes[k], position) && Push(before.parts[k], now.parts[k], position);
      if (pushed && !listed) found = List(swept, found, v, start);
    }
    before = now;
  }
  return found;
}

// Shares of a way at which it enters and leaves a box; none where the first is not less.
struct Within {
  float enters = 0, leaves = 1;
};

Within PartOfWay(const Box& box, const float* from, const float* way) {
  Within within;
  for (size_t c = 0; c < 3; ++c) {
    if (std::fabs(way[c]) < 1e-12f) continue;
    const float low = (box.low[c] - from[c]) / way[c], high = (box.high[c] - from[c]) / way[c];
    const float first = low < high ? low : high, last = low < high ? high : low;
    within.enters = first > within.enters ? first : within.enters;
    within.leaves = last < within.leaves ? last : within.leaves;
  }
  return within;
}

// Takes a vertex from `at` towards `goal`, until it meets a part of the limb from the side where the garment lies in
// the bind pose; false where it does not. There it sticks: slid along the limb, the hem would come down to the ankle.
bool Fall(const Limb& limb, const Box& around, const float* bound, const float* goal, float* at) {
  const float from[3] = {at[0], at[1], at[2]}, way[3] = {goal[0] - at[0], goal[1] - at[1], goal[2] - at[2]};
  const Within within = PartOfWay(around, from, way);
  if (!(within.enters < within.leaves)) return false;
  const float wanted = std::sqrt(Dot(way, way)) / (kStep * limb.parts[0]->scale) + 1;
  const float steps = static_cast<float>(static_cast<int>(wanted < kMostFallSteps ? wanted : kMostFallSteps));
  const float first = static_cast<float>(static_cast<int>(within.enters * steps));
  bool was_in[kMostParts] = {};
  for (float step = first; step <= within.leaves * steps; ++step) {
    for (size_t c = 0; c < 3; ++c) at[c] = from[c] + step / steps * way[c];
    for (size_t k = 0; k < limb.count; ++k) {
      const LimbCore& part = *limb.parts[k];
      float away[3], radius, side[3];
      const bool in = IsInCore(part, at, away, &radius), enters = in && !was_in[k] && step > first;
      was_in[k] = in;
      if (!enters) continue;
      OwnSide(part, bound, side);
      if (Dot(side, away) < 0) continue;
      LimbCore before = part;
      for (size_t c = 0; c < 3; ++c) before.posed_from[c] += way[c] / steps;
      if (Push(before, part, at)) return true;
    }
  }
  return false;
}

// Lets the cloth under which a limb lies fall onto it from where the limb would wear it. Lists what it meets; returns
// how many vertices that are. The others are where they were drawn.
size_t FallOnto(const ModelView& model, const float* matrices, const LimbCores& limbs, const Limb& limb,
                const SweptCloth& swept, const Surface& surface) {
  const WornCloth worn(model, matrices, limbs, limb);
  Box around;
  for (size_t k = 0; k < limb.count; ++k) Extend(*limb.parts[k], &around);
  size_t found = 0;
  for (size_t v = 0; v < model.vertex_count && found < kMostDeep; ++v) {
    if ((swept.limbs[v] & limb.bit) == 0) continue;
    float *position = surface.PositionOf(v), at[3];
    if (!(worn.Place(v, at) > kOwn)) continue;
    if (!Fall(limb, around, model.template_positions + 3 * v, position, at)) continue;
    found = List(swept, found, static_cast<uint16_t>(v), position);
    for (size_t c = 0; c < 3; ++c) position[c] = at[c];
  }
  return found;
}

// Each of the vertices from `first` on moves as its neighbours do on average, by `most` at most.
void Follow(const SweptCloth& swept, size_t first, size_t found, const float* sums, float most,
            const Surface& surface) {
  for (size_t i = first; i < found; ++i) {
    const float *sum = sums + 4 * i, *start = swept.starts + 3 * i;
    if (!(sum[3] > 0)) continue;
    float *position = surface.PositionOf(swept.vertices[i]), step[3];
    for (size_t c = 0; c < 3; ++c) step[c] = start[c] + sum[c] / sum[3] - position[c];
    const float length = std::sqrt(Dot(step, step)), share = length > most ? most / length : 1.0f;
    for (size_t c = 0; c < 3; ++c) position[c] += share * step[c];
  }
}

// Cloth around the `pushed` vertices gives way: each vertex moves as its neighbours do on average. Then they ease too,
// by steps that do not lead through the limb. `scratch`: sums and triangles.
void Spread(const ModelView& model, const Limb& limb, const SweptCloth& swept, size_t pushed, const DeepCloth& scratch,
            const Surface& surface) {
  size_t found = pushed;
  for (int ring = 0; ring < kRings; ++ring) {
    found = AddRing(model, swept.places, swept.vertices, found, [&](uint16_t v, size_t place) {
      List(swept, place, v, surface.PositionOf(v));
      return true;
    });
  }
  const size_t triangles = ListTriangles(model, swept.places, swept.places, scratch.triangles);
  for (int pass = 0; pass < kSpreads + kEasings; ++pass) {
    SumMoves(model, swept.places, swept.starts, scratch.triangles, triangles, surface, swept.vertices, found,
             scratch.sums);
    if (pass < kSpreads) {
      Follow(swept, pushed, found, scratch.sums, kFar, surface);
      continue;
    }
    Follow(swept, 0, found, scratch.sums, kStep * limb.parts[0]->scale, surface);
    for (size_t i = 0; i < found; ++i) {
      for (size_t k = 0; k < limb.count; ++k) LiftAcross(*limb.parts[k], surface.PositionOf(swept.vertices[i]));
    }
  }
}

void TakeBack(const ModelView& model, const uint16_t* places, const float* starts, const Surface& surface) {
  for (size_t v = 0; v < model.vertex_count; ++v) {
    if (places[v] == kNotDeep) continue;
    for (size_t c = 0; c < 3; ++c) surface.PositionOf(v)[c] = starts[size_t{3} * places[v] + c];
  }
}

void ClearPlaces(const ModelView& model, const SweptCloth& swept) {
  for (size_t v = 0; v < model.vertex_count; ++v) swept.places[v] = kNotDeep;
}

// What the tries left stretched over the limbs `torn` is drawn together, unless a limb comes deeper into it for that or
// through it.
void DrawTogetherOrLeave(const ModelView& model, const float* matrices, const LimbCores& limbs, uint8_t torn,
                         const SweptCloth& swept, const DeepCloth& scratch, const Surface& surface) {
  const size_t found = ListStretched(model, limbs, torn, swept, surface);
  if (found == 0) return;
  const size_t triangles = ListTriangles(model, swept.places, swept.places, scratch.triangles);
  const auto look = [&](float* deep, int* pierced) {
    VisitLimbs(limbs, [&](const LimbCore&, uint32_t upper, uint8_t bit) {
      Limb limb;
      if ((torn & bit) == 0 || !FillLimb(model, matrices, limbs, upper, bit, &limb)) return;
      *deep += TornBy(model, limb, scratch.triangles, triangles, swept, surface);
      *pierced += IsPierced(model, limb, scratch.triangles, triangles, swept, surface) ? 1 : 0;
    });
  };
  float before = 0, after = 0;
  int pierced_before = 0, pierced_after = 0;
  look(&before, &pierced_before);
  DrawTogether(model, limbs, torn, swept, found, scratch.triangles, triangles, scratch.sums, surface);
  look(&after, &pierced_after);
  if (after > before || pierced_after > pierced_before) TakeBack(model, swept.places, swept.starts, surface);
  ClearPlaces(model, swept);
}

}  // namespace

SweptCloth PlaceSweptCloth(const ModelView& model, Arena* arena) {
  return {arena->Take<uint8_t>(model.vertex_count), arena->Take<uint16_t>(model.vertex_count),
          arena->Take<uint16_t>(kMostDeep), arena->Take<float>(3 * kMostDeep)};
}

void FindSweptCloth(const ModelView& model, const LimbCores& limbs, const Sleeves& sleeves, const SweptCloth& swept) {
  const uint8_t* classes = model.body.touch_classes;
  uint8_t in_sleeves = 0;
  for (size_t v = 0; v < model.vertex_count; ++v) {
    const auto bit = static_cast<uint8_t>(classes == nullptr ? 0u : 1u << classes[v]);
    uint32_t nearest;
    const uint32_t under = CoresUnder(limbs, model.template_positions + 3 * v, bit, &nearest);
    swept.limbs[v] = 0;
    VisitLimbs(limbs, [&](const LimbCore& upper, uint32_t core, uint8_t limb) {
      if (((under >> core | under >> upper.below) & 1u) != 0) swept.limbs[v] |= limb;
      if (sleeves.cores[v] == core || sleeves.cores[v] == upper.below) in_sleeves |= limb;
    });
  }
  for (size_t v = 0; v < model.vertex_count; ++v) swept.limbs[v] &= static_cast<uint8_t>(~in_sleeves);
  ClearPlaces(model, swept);
}

uint8_t LayOrSweep(const ModelView& model, bool mirrored, const float* matrices, const LimbCores& limbs,
                   const TouchLists& lists, const DeepCloth& deep, const SweptCloth& swept, const Surface& surface) {
  uint32_t cores = 0;  // of limbs that have taken their cloth along
  uint8_t torn_limbs = 0, out_of_cloth = 0;
  int tries = 0;
  size_t moved = LayOverLimbs(model, mirrored, limbs, cores, lists, deep, surface);
  VisitLimbs(limbs, [&](const LimbCore&, uint32_t upper, uint8_t bit) {
    Limb limb;
    if (tries >= kMostTries || !FillLimb(model, matrices, limbs, upper, bit, &limb)) return;
    const float torn = TornBy(model, limb, deep.triangles, moved, swept, surface);
    if (torn > kTorn || IsPierced(model, limb, deep.triangles, moved, swept, surface)) out_of_cloth |= bit;
    if (!(torn > kTorn)) return;
    torn_limbs |= bit;
    TakeBack(model, deep.places, deep.starts, surface);
    const auto put_on = [&](const Try& how) {
      ++tries;
      size_t pushed = how.falls ? FallOnto(model, matrices, limbs, limb, swept, surface) : 0;
      if (how.sweeps_from > 0) pushed = PushAlong(model, limb, how.sweeps_from, swept, deep.places, pushed, surface);
      Spread(model, limb, swept, pushed, deep, surface);
      LayOverLimbs(model, mirrored, limbs, cores | limb.cores, lists, deep, surface);
      moved = ListTriangles(model, deep.places, swept.places, deep.triangles);
    };
    bool kept = false;
    const Try* pierced = nullptr;  // the first that mends, but a bone goes through it
    for (const Try& how : kTries) {
      if (tries >= kMostTries || kept) break;
      put_on(how);
      const float left = TornBy(model, limb, deep.triangles, moved, swept, surface);
      const bool mended = !(left > kTorn) || left < kLess * torn;
      kept = mended && !IsPierced(model, limb, deep.triangles, moved, swept, surface);
      if (!kept) {
        TakeBack(model, deep.places, deep.starts, surface);
        TakeBack(model, swept.places, swept.starts, surface);
        if (mended && pierced == nullptr) pierced = &how;
      }
      ClearPlaces(model, swept);
    }
    if (!kept && pierced != nullptr) {
      put_on(*pierced);
      ClearPlaces(model, swept);
      kept = true;
    }
    if (kept) {
      cores |= limb.cores;
    } else {
      moved = LayOverLimbs(model, mirrored, limbs, cores, lists, deep, surface);
    }
  });
  DrawTogetherOrLeave(model, matrices, limbs, torn_limbs, swept, deep, surface);
  return out_of_cloth;
}

}  // namespace dcloth::engine
