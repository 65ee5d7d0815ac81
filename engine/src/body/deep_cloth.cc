#include "engine/src/body/deep_cloth.h"

#include <cmath>
#include <cstring>

#include "kernels/kernels.h"

namespace dcloth::engine {
namespace {

using format::ModelView;
using kernels::kNearestPatch;

constexpr float kMostTravel = 0.25f;  // metres; cloth further in than that stays
constexpr int kHalvings = 8;          // of it, to find the surface of a core
constexpr int kMostLimbs = 3;         // that a vertex leaves one after another
constexpr int kRingsBehind = 16;      // around deep cloth, of cloth behind a core
constexpr int kRings = 2;             // of neighbours that give way
constexpr int kSmoothings = 8;
constexpr uint16_t kAsked = kNotDeep - 1;  // a place: not behind a core; more than any place
static_assert(kMostDeep <= kAsked);

const float* BoundOf(const ModelView& model, size_t vertex) { return model.template_positions + 3 * vertex; }

uint8_t BitOf(const ModelView& model, size_t vertex) {
  const uint8_t* classes = model.body.touch_classes;
  return static_cast<uint8_t>(classes == nullptr ? 0u : 1u << classes[vertex]);
}

size_t PatchCount(const ModelView& model) { return model.vertex_count / kNearestPatch + format::kMaxTouchClasses; }

bool IsSleeve(const DeepCloth& deep, size_t vertex) { return deep.sleeves.cores[vertex] != kNoSleeve; }

size_t Most(const ModelView& model) { return model.vertex_count < kMostDeep ? model.vertex_count : kMostDeep; }

// visit(touch, patch, vertices, count) for runs of neighbours of one class.
template <typename Visit>
void VisitPatches(const ModelView& model, const TouchLists& lists, Visit visit) {
  uint16_t patch = 0;
  for (size_t c = 0; c < ClassCount(model); ++c) {
    const TouchClass touch = ClassAt(model, lists, c);
    for (size_t begin = 0; begin < touch.vertex_count; begin += kNearestPatch, ++patch) {
      const size_t left = touch.vertex_count - begin;
      visit(touch, patch, touch.vertices + begin, left < kNearestPatch ? left : kNearestPatch);
    }
  }
}

// The cores, a bit each, that reach into the ball around some vertices.
uint32_t CoresNear(const LimbCores& limbs, const Surface& surface, const uint16_t* vertices, size_t count) {
  float low[3], high[3], squared = 0;
  for (size_t c = 0; c < 3; ++c) low[c] = high[c] = surface.PositionOf(vertices[0])[c];
  for (size_t i = 1; i < count; ++i) {
    const float* p = surface.PositionOf(vertices[i]);
    for (size_t c = 0; c < 3; ++c) {
      low[c] = p[c] < low[c] ? p[c] : low[c];
      high[c] = p[c] > high[c] ? p[c] : high[c];
    }
  }
  const float centre[3] = {0.5f * (low[0] + high[0]), 0.5f * (low[1] + high[1]), 0.5f * (low[2] + high[2])};
  for (size_t i = 0; i < count; ++i) {
    const float* p = surface.PositionOf(vertices[i]);
    const float apart[3] = {p[0] - centre[0], p[1] - centre[1], p[2] - centre[2]};
    const float found = Dot(apart, apart);
    squared = found > squared ? found : squared;
  }
  const float radius = std::sqrt(squared);
  uint32_t near = 0;
  for (uint32_t k = 0; k < *limbs.count; ++k) near |= ReachesInto(limbs.cores[k], centre, radius) ? 1u << k : 0u;
  return near;
}

bool IsInAny(const LimbCores& limbs, uint32_t which, const float* point) {
  float away[3], radius;
  for (uint32_t k = 0; k < *limbs.count; ++k) {
    if ((which >> k & 1u) != 0 && IsInCore(limbs.cores[k], point, away, &radius)) return true;
  }
  return false;
}

// All vertices in a core that is under them; returns how many.
size_t FindDeep(const ModelView& model, const LimbCores& limbs, const TouchLists& lists, const DeepCloth& deep,
                const Surface& surface) {
  size_t found = 0;
  const size_t most = Most(model);
  VisitPatches(model, lists, [&](const TouchClass& touch, uint16_t patch, const uint16_t* vertices, size_t count) {
    const uint32_t near = CoresNear(limbs, surface, vertices, count);
    if (near == 0) return;
    for (size_t i = 0; i < count && found < most; ++i) {
      const uint16_t v = vertices[i];
      const float* position = surface.PositionOf(v);
      if (!IsInAny(limbs, near, position)) continue;
      uint32_t nearest;
      const uint32_t under = CoresUnder(limbs, BoundOf(model, v), touch.bit, &nearest);
      if (!IsInAny(limbs, near & under, position)) continue;
      deep.vertices[found] = v;
      deep.patches[found] = patch;
      deep.nearest[found] = static_cast<uint8_t>(nearest);
      deep.under[found++] = under;
    }
  });
  return found;
}

// Of patches with one of the `found` vertices. A patch's vector area depends on its edge alone, so pleats and folded
// layers do not turn it. `places` is scratch.
void FillSides(const ModelView& model, bool mirrored, const TouchLists& lists, const DeepCloth& deep, size_t found,
               const Surface& surface) {
  constexpr uint16_t kUnwanted = kNotDeep;
  size_t next = 0;  // of `found`, which lie in the order of patches
  VisitPatches(model, lists, [&](const TouchClass&, uint16_t patch, const uint16_t* vertices, size_t count) {
    const bool wanted = next < found && deep.patches[next] == patch;
    while (next < found && deep.patches[next] == patch) ++next;
    for (size_t i = 0; i < count; ++i) deep.places[vertices[i]] = wanted ? patch : kUnwanted;
  });
  const size_t patches = PatchCount(model);
  for (size_t i = 0; i < 3 * patches; ++i) deep.sides[i] = 0;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    if ((deep.places[face[0]] & deep.places[face[1]] & deep.places[face[2]]) == kUnwanted) continue;
    const float *a = surface.PositionOf(face[0]), *b = surface.PositionOf(face[1]), *p = surface.PositionOf(face[2]);
    const float ab[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, ac[3] = {p[0] - a[0], p[1] - a[1], p[2] - a[2]};
    const float area[3] = {ab[1] * ac[2] - ab[2] * ac[1], ab[2] * ac[0] - ab[0] * ac[2], ab[0] * ac[1] - ab[1] * ac[0]};
    for (size_t k = 0; k < 3; ++k) {
      if (deep.places[face[k]] == kUnwanted) continue;
      float* side = deep.sides + size_t{3} * deep.places[face[k]];
      for (size_t c = 0; c < 3; ++c) side[c] += area[c];
    }
  }
  for (size_t i = 0; i < patches; ++i) {
    float* side = deep.sides + 3 * i;
    const float length = std::sqrt(Dot(side, side)), scale = length > 0 ? (mirrored ? -1.0f : 1.0f) / length : 0.0f;
    for (size_t c = 0; c < 3; ++c) side[c] *= scale;
  }
}

// How far along the unit vector `side` a point in a core leaves it, at most `most`.
float WayOut(const LimbCore& core, const float* point, const float* side, float most) {
  float inside = 0, outside = most, away[3], radius;
  for (int step = 0; step < kHalvings; ++step) {
    const float middle = 0.5f * (inside + outside);
    const float at[3] = {point[0] + middle * side[0], point[1] + middle * side[1], point[2] + middle * side[2]};
    (IsInCore(core, at, away, &radius) ? inside : outside) = middle;
  }
  return outside;
}

// Straight out of all cores in which it lies, or not at all.
bool LiftOut(const LimbCores& limbs, uint32_t under, const float* side, float* position) {
  float at[3] = {position[0], position[1], position[2]}, away[3], radius, travel = 0, most = 0;
  for (int leave = 0; leave < kMostLimbs; ++leave) {
    float way = 0;
    for (uint32_t k = 0; k < *limbs.count; ++k) {
      const LimbCore& core = limbs.cores[k];
      if ((under >> k & 1u) == 0 || !IsInCore(core, at, away, &radius)) continue;
      most = kMostTravel * core.scale;
      const float out = WayOut(core, at, side, most);
      way = out > way ? out : way;
    }
    if (!(way > 0)) break;
    travel += way;
    if (!(travel < most)) return false;
    for (size_t c = 0; c < 3; ++c) at[c] += way * side[c];
  }
  for (size_t c = 0; c < 3; ++c) position[c] = at[c];
  return true;
}

// Unit vector of a way from a bone; returns the share that OwnSide does.
float Outward(const float* away, float* out) {
  const float length = std::sqrt(Dot(away, away));
  for (size_t c = 0; c < 3; ++c) out[c] = length > 0 ? away[c] / length : 0.0f;
  return length > 0 ? 1.0f : 0.0f;
}

// Out of the cores to the side of the vertex's patch; where it is bound close to the limb it is in, to its own side:
// the patch of such cloth may go around the limb and have no side. So does the cloth of an armhole: its patch is half
// the trunk's, whose side faces a lowered arm. A sleeve leaves its limb where it is: it may be turned about it, by half
// a turn where a forearm is.
void LiftDeep(const ModelView& model, const LimbCores& limbs, const DeepCloth& deep, size_t place, float* position) {
  const float *side = deep.sides + size_t{3} * deep.patches[place], *bound = BoundOf(model, deep.vertices[place]);
  float way[3] = {side[0], side[1], side[2]}, out[3], away[3], radius;
  for (uint32_t k = 0; k < *limbs.count && deep.nearest[place] < kMostCores; ++k) {
    const LimbCore& core = limbs.cores[k];
    if (!BendsWith(limbs, deep.nearest[place], k) || !IsInCore(core, position, away, &radius)) continue;
    float share = IsSleeve(deep, deep.vertices[place]) ? Outward(away, out) : OwnSide(core, bound, out);
    if (core.in_sleeve && share > 0) share = 1;
    for (size_t c = 0; c < 3; ++c) way[c] = (1 - share) * side[c] + share * out[c];
    const float length = std::sqrt(Dot(way, way));
    for (size_t c = 0; c < 3; ++c) way[c] = length > 0 ? way[c] / length : side[c];
    break;
  }
  LiftOut(limbs, deep.under[place], way, position);
}

void FillPlaces(const ModelView& model, const DeepCloth& deep, size_t found) {
  for (size_t v = 0; v < model.vertex_count; ++v) deep.places[v] = kNotDeep;
  for (size_t i = 0; i < found; ++i) deep.places[deep.vertices[i]] = static_cast<uint16_t>(i);
}

// Of vertex `v` at `place`; returns its nearest core.
uint32_t FillUnder(const ModelView& model, const LimbCores& limbs, const DeepCloth& deep, uint16_t v, size_t place) {
  uint32_t nearest;
  deep.under[place] = CoresUnder(limbs, BoundOf(model, v), BitOf(model, v), &nearest);
  deep.nearest[place] = static_cast<uint8_t>(nearest);
  return nearest;
}

// Cloth that joins deep cloth and lies behind the core of the bone nearest to it; returns how many there are then.
// Sleeves have their limb in them, and are behind none.
size_t AddBehind(const ModelView& model, const LimbCores& limbs, uint32_t swept, const DeepCloth& deep, size_t found,
                 const Surface& surface) {
  FillPlaces(model, deep, found);
  for (int ring = 0; ring < kRingsBehind; ++ring) {
    const size_t before = found;
    found = AddRing(model, deep.places, deep.vertices, found, [&](uint16_t v, size_t place) {
      if (IsSleeve(deep, v)) {
        deep.places[v] = kAsked;
        return false;
      }
      float out[3], middle[3];
      const uint32_t nearest = FillUnder(model, limbs, deep, v, place);
      const bool behind = IsBehindCore(limbs, deep.under[place] & ~swept, nearest, BoundOf(model, v),
                                       surface.PositionOf(v), out, middle);
      if (!behind) deep.places[v] = kAsked;
      return behind;
    });
    if (found == before) break;
  }
  return found;
}

// Neighbours of what was found join it; returns how many there are then. `places` is filled in.
size_t AddRings(const ModelView& model, const LimbCores& limbs, const DeepCloth& deep, size_t found) {
  FillPlaces(model, deep, found);
  for (int ring = 0; ring < kRings; ++ring) {
    found = AddRing(model, deep.places, deep.vertices, found, [&](uint16_t v, size_t place) {
      FillUnder(model, limbs, deep, v, place);
      return true;
    });
  }
  return found;
}

// Around the limb that has gone through it.
void LiftAround(const ModelView& model, const LimbCores& limbs, uint32_t swept, const DeepCloth& deep, size_t place,
                float* position) {
  float out[3], at[3];
  const float* bound = BoundOf(model, deep.vertices[place]);
  if (!IsBehindCore(limbs, deep.under[place] & ~swept, deep.nearest[place], bound, position, out, at)) return;
  if (!LiftOut(limbs, deep.under[place], out, at)) return;
  for (size_t c = 0; c < 3; ++c) position[c] = at[c];
}

// Each vertex moves as its neighbours do on average, and from there across the bone out of the cores under it. Moves
// are smoothed, not places: so pleats stay, and cloth that is hardly in a core is hardly moved.
void Smooth(const ModelView& model, const LimbCores& limbs, const DeepCloth& deep, size_t found, size_t triangles,
            const Surface& surface) {
  SumMoves(model, deep.places, deep.starts, deep.triangles, triangles, surface, deep.vertices, found, deep.sums);
  for (size_t i = 0; i < found; ++i) {
    const float *sum = deep.sums + 4 * i, *start = deep.starts + 3 * i;
    if (!(sum[3] > 0)) continue;
    float* position = surface.PositionOf(deep.vertices[i]);
    for (size_t c = 0; c < 3; ++c) position[c] = start[c] + sum[c] / sum[3];
    for (uint32_t k = 0; k < *limbs.count; ++k) {
      if ((deep.under[i] >> k & 1u) != 0) LiftAcross(limbs.cores[k], position);
    }
  }
}

}  // namespace

DeepCloth PlaceDeepCloth(const ModelView& model, const Sleeves& sleeves, Arena* arena) {
  const size_t most = Most(model);
  DeepCloth deep = {};
  deep.sleeves = sleeves;
  deep.places = arena->Take<uint16_t>(model.vertex_count);
  deep.vertices = arena->Take<uint16_t>(most);
  deep.patches = arena->Take<uint16_t>(most);
  deep.under = arena->Take<uint32_t>(most);
  deep.nearest = arena->Take<uint8_t>(most);
  deep.triangles = arena->Take<uint32_t>(3 * most);
  deep.starts = arena->Take<float>(3 * most);
  deep.sums = arena->Take<float>(8 * (most + 1));
  deep.sides = arena->Take<float>(3 * PatchCount(model));
  return deep;
}

size_t LayOverLimbs(const ModelView& model, bool mirrored, const LimbCores& limbs, uint32_t swept,
                    const TouchLists& lists, const DeepCloth& deep, const Surface& surface) {
  const size_t lifted = *limbs.count == 0 ? 0 : FindDeep(model, limbs, lists, deep, surface);
  if (lifted == 0) {
    for (size_t v = 0; v < model.vertex_count; ++v) deep.places[v] = kNotDeep;
    return 0;
  }
  FillSides(model, mirrored, lists, deep, lifted, surface);
  const size_t behind = AddBehind(model, limbs, swept, deep, lifted, surface);
  const size_t found = AddRings(model, limbs, deep, behind);
  for (size_t i = 0; i < found; ++i) {
    float* position = surface.PositionOf(deep.vertices[i]);
    for (size_t c = 0; c < 3; ++c) deep.starts[3 * i + c] = position[c];
    if (i < lifted) {
      LiftDeep(model, limbs, deep, i, position);
    } else if (i < behind) {
      LiftAround(model, limbs, swept, deep, i, position);
    }
  }
  const size_t triangles = ListTriangles(model, deep.places, deep.places, deep.triangles);
  for (int k = 0; k < kSmoothings; ++k) Smooth(model, limbs, deep, found, triangles, surface);
  return triangles;
}

size_t ListTriangles(const ModelView& model, const uint16_t* places, const uint16_t* other_places,
                     uint32_t* triangles) {
  size_t count = 0;
  const size_t most = 3 * Most(model);
  for (size_t t = 0; t < model.triangle_count && count < most; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    const bool listed = (places[face[0]] & places[face[1]] & places[face[2]]) != kNotDeep ||
                        (other_places[face[0]] & other_places[face[1]] & other_places[face[2]]) != kNotDeep;
    if (listed) triangles[count++] = static_cast<uint32_t>(t);
  }
  return count;
}

void SumMoves(const ModelView& model, const uint16_t* places, const float* starts, const uint32_t* triangles,
              size_t triangle_count, const Surface& surface, const uint16_t* vertices, size_t found, float* sums) {
  constexpr size_t kRow = 4;
  float* moves = sums + kRow * (Most(model) + 1);
  for (size_t i = 0; i < found; ++i) {
    const float* position = surface.PositionOf(vertices[i]);
    for (size_t c = 0; c < 3; ++c) moves[kRow * i + c] = position[c] - starts[3 * i + c];
    moves[kRow * i + 3] = 1;
  }
  const float stays[kRow] = {0, 0, 0, 1};
  std::memcpy(moves + kRow * found, stays, sizeof stays);
  std::memset(sums, 0, sizeof(float) * kRow * (found + 1));
  for (size_t t = 0; t < triangle_count; ++t) {
    const uint16_t* face = model.faces + size_t{3} * triangles[t];
    size_t place[3];
    float corners[3][kRow];
    for (size_t k = 0; k < 3; ++k) {
      place[k] = kRow * (places[face[k]] < found ? places[face[k]] : found);
      std::memcpy(corners[k], moves + place[k], sizeof corners[k]);
    }
    for (size_t k = 0; k < 3; ++k) {
      float sum[kRow];
      std::memcpy(sum, sums + place[k], sizeof sum);
      for (size_t c = 0; c < kRow; ++c) sum[c] = sum[c] + corners[(k + 1) % 3][c] + corners[(k + 2) % 3][c];
      std::memcpy(sums + place[k], sum, sizeof sum);
    }
  }
}

float MoveOf(const DeepCloth& deep, const Surface& surface, size_t vertex) {
  const uint16_t place = deep.places[vertex];
  if (place == kNotDeep) return 0;
  const float *position = surface.PositionOf(vertex), *start = deep.starts + size_t{3} * place;
  const float move[3] = {position[0] - start[0], position[1] - start[1], position[2] - start[2]};
  return std::sqrt(Dot(move, move));
}

}  // namespace dcloth::engine
