#include "engine/src/body/swept_limbs.h"

#include <cmath>

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr int kMostSweeps = 3;    // of a frame
constexpr size_t kMostParts = 3;  // of a limb: thigh, shank, foot
// What is torn, in triangles: the sum over those through a limb of how much nearer to its bone than kDeep they come, in
// shares of the core's radius. So much is a tear; so much of what there was is none.
constexpr float kDeep = 0.7f, kTorn = 0.05f, kLess = 0.25f;
constexpr float kStep = 0.02f;    // metres, of a sweep: less than a core is thick
constexpr float kMostSteps = 32;  // longer sweeps take longer steps
constexpr int kRings = 8;         // around what was pushed, that give way
constexpr int kSpreads = 16;
constexpr float kFar = 1e18f;

// Where a sweep starts: shares of the turns that take a limb to where its joints hold it in the bind pose.
struct Start {
  float upper, lower;  // at the hip, at the knee
};
constexpr Start kStarts[] = {{0.25f, 0.25f}, {0.5f, 0.5f}, {0, 0.25f}};

// The smallest that takes a posed bone to where the joint above it holds it in the bind pose.
struct Turn {
  float axis[3];       // unit vector, or zero
  float cosine, sine;  // of half the angle
};

Turn TurnBack(const float* above, const LimbCore& core) {
  const float bone[3] = {core.to[0] - core.from[0], core.to[1] - core.from[1], core.to[2] - core.from[2]};
  float rest[3];
  for (size_t r = 0; r < 3; ++r) rest[r] = Dot(above + 4 * r, bone);
  Turn turn = {};
  Cross(core.along, rest, turn.axis);
  const float sine = std::sqrt(Dot(turn.axis, turn.axis)), cosine = Dot(core.along, rest);
  const float length = std::sqrt(sine * sine + cosine * cosine), share = length > 0 ? cosine / length : 1.0f;
  turn.cosine = std::sqrt(0.5f * (share > -1 ? 1 + share : 0.0f));
  turn.sine = std::sqrt(0.5f * (share < 1 ? 1 - share : 0.0f));
  for (float& c : turn.axis) c = sine > 0 ? c / sine : 0.0f;
  return turn;
}

void Rotate(const float* axis, float cosine, float sine, float* vector) {
  float across[3];
  Cross(axis, vector, across);
  const float along = Dot(axis, vector) * (1 - cosine);
  for (size_t c = 0; c < 3; ++c) vector[c] = cosine * vector[c] + sine * across[c] + along * axis[c];
}

// By a share of the turn: between quaternions, straight.
void RotateAbout(const Turn& turn, float share, const float* centre, LimbCore* core) {
  const float w = 1 - share + share * turn.cosine, x = share * turn.sine, inverse = 1 / (w * w + x * x);
  const float cosine = (w * w - x * x) * inverse, sine = 2 * w * x * inverse;
  float from[3];
  for (size_t c = 0; c < 3; ++c) from[c] = core->posed_from[c] - centre[c];
  Rotate(turn.axis, cosine, sine, from);
  for (size_t c = 0; c < 3; ++c) core->posed_from[c] = centre[c] + from[c];
  Rotate(turn.axis, cosine, sine, core->along);
  for (float(&around)[3] : core->posed_around) Rotate(turn.axis, cosine, sine, around);
}

struct Limb {
  const LimbCore* parts[kMostParts];  // as posed
  size_t count;
  Turn upper, lower;
  uint8_t bit;     // of SweptCloth::limbs
  uint32_t cores;  // a bit each
};

struct LimbPose {
  LimbCore parts[kMostParts];
};

LimbPose PoseAt(const Limb& limb, const Start& shares) {
  LimbPose pose = {};
  for (size_t k = 0; k < limb.count; ++k) {
    pose.parts[k] = *limb.parts[k];
    if (k > 0) RotateAbout(limb.lower, shares.lower, limb.parts[1]->posed_from, &pose.parts[k]);
    RotateAbout(limb.upper, shares.upper, limb.parts[0]->posed_from, &pose.parts[k]);
  }
  return pose;
}

// False where it cannot be turned.
bool FillLimb(const ModelView& model, const float* matrices, const LimbCores& limbs, uint32_t upper, uint8_t bit,
              Limb* limb) {
  *limb = {};
  limb->bit = bit;
  for (uint32_t k = upper; k != kMostCores && limb->count < kMostParts; k = limbs.cores[k].below) {
    if (!(limbs.cores[k].scale > 0)) return false;
    limb->parts[limb->count++] = &limbs.cores[k];
    limb->cores |= 1u << k;
  }
  const uint32_t joint = limb->parts[0]->joint, above = model.parents[joint];
  if (above == format::kNoParent) return false;
  limb->upper = TurnBack(matrices + size_t{12} * above, *limb->parts[0]);
  limb->lower = TurnBack(matrices + size_t{12} * joint, *limb->parts[1]);
  return true;
}

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

// Vertex `v`, which lies at `start` and is not listed.
size_t Add(const SweptCloth& swept, size_t found, uint16_t v, const float* start) {
  for (size_t c = 0; c < 3; ++c) swept.starts[3 * found + c] = start[c];
  swept.vertices[found] = v;
  swept.places[v] = static_cast<uint16_t>(found);
  return found + 1;
}

// Where a limb is after a step, of the last of which it is as posed.
LimbPose PoseAfter(const Limb& limb, const Start& from, float step, float steps) {
  const float left = 1 - step / steps;
  return PoseAt(limb, {left * from.upper, left * from.lower});
}

// Lists what a limb pushes on its way; returns how many vertices that are. `scratch` [n].
size_t PushAlong(const ModelView& model, const Limb& limb, const Start& from, const SweptCloth& swept,
                 uint16_t* scratch, const Surface& surface) {
  LimbPose before = PoseAt(limb, from);
  const float steps = StepsOf(limb, before);
  Box way;
  for (float step = 0; step <= steps; ++step) {
    const LimbPose pose = PoseAfter(limb, from, step, steps);
    for (size_t k = 0; k < limb.count; ++k) Extend(pose.parts[k], &way);
  }
  size_t near = 0, found = 0;
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
      if (pushed && !listed) found = Add(swept, found, v, start);
    }
    before = now;
  }
  return found;
}

// Cloth around the `pushed` vertices gives way: each vertex moves as its neighbours do on average. `scratch`: sums and
// triangles.
void Spread(const ModelView& model, const SweptCloth& swept, size_t pushed, const DeepCloth& scratch,
            const Surface& surface) {
  size_t found = pushed;
  for (int ring = 0; ring < kRings; ++ring) {
    found = AddRing(model, swept.places, swept.vertices, found, [&](uint16_t v, size_t place) {
      Add(swept, place, v, surface.PositionOf(v));
      return true;
    });
  }
  const size_t triangles = ListTriangles(model, swept.places, swept.places, scratch.triangles);
  for (int pass = 0; pass < kSpreads; ++pass) {
    SumMoves(model, swept.places, swept.starts, scratch.triangles, triangles, surface, swept.vertices, found,
             scratch.sums);
    for (size_t i = pushed; i < found; ++i) {
      const float *sum = scratch.sums + 4 * i, *start = swept.starts + 3 * i;
      float* position = surface.PositionOf(swept.vertices[i]);
      for (size_t c = 0; c < 3 && sum[3] > 0; ++c) position[c] = start[c] + sum[c] / sum[3];
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

void LayOrSweep(const ModelView& model, bool mirrored, const float* matrices, const LimbCores& limbs,
                const TouchLists& lists, const DeepCloth& deep, const SweptCloth& swept, const Surface& surface) {
  uint32_t cores = 0;  // of limbs that were swept
  int sweeps = 0;
  size_t moved = LayOverLimbs(model, mirrored, limbs, cores, lists, deep, surface);
  VisitLimbs(limbs, [&](const LimbCore&, uint32_t upper, uint8_t bit) {
    Limb limb;
    if (sweeps == kMostSweeps || !FillLimb(model, matrices, limbs, upper, bit, &limb)) return;
    const float torn = TornBy(model, limb, deep.triangles, moved, swept, surface);
    if (!(torn > kTorn)) return;
    TakeBack(model, deep.places, deep.starts, surface);
    for (const Start& from : kStarts) {
      if (sweeps == kMostSweeps) break;
      ++sweeps;
      Spread(model, swept, PushAlong(model, limb, from, swept, deep.places, surface), deep, surface);
      LayOverLimbs(model, mirrored, limbs, cores | limb.cores, lists, deep, surface);
      moved = ListTriangles(model, deep.places, swept.places, deep.triangles);
      const float left = TornBy(model, limb, deep.triangles, moved, swept, surface);
      const bool mended = !(left > kTorn) || left < kLess * torn;
      if (!mended) {
        TakeBack(model, deep.places, deep.starts, surface);
        TakeBack(model, swept.places, swept.starts, surface);
      }
      ClearPlaces(model, swept);
      if (!mended) continue;
      cores |= limb.cores;
      return;
    }
    moved = LayOverLimbs(model, mirrored, limbs, cores, lists, deep, surface);
  });
}

}  // namespace dcloth::engine
