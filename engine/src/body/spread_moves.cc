#include "engine/src/body/spread_moves.h"

#include <cmath>
#include <utility>

#include "engine/src/body/vec.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

constexpr int kRings = 4;  // around what was moved, that give way
constexpr int kSmoothings = 12;
constexpr double kWhole = UINT16_MAX;  // of a share

Vec StartOf(const DeepCloth& deep, size_t place) { return VecAt(deep.starts + 3 * place); }

Vec MoveAt(const DeepCloth& deep, const Surface& surface, size_t place) {
  return VecAt(surface.PositionOf(deep.vertices[place])) - StartOf(deep, place);
}

void Put(Vec at, float* position) {
  position[0] = static_cast<float>(at.x);
  position[1] = static_cast<float>(at.y);
  position[2] = static_cast<float>(at.z);
}

size_t ListAt(const DeepCloth& deep, size_t listed, uint16_t vertex, const float* start) {
  for (size_t c = 0; c < 3; ++c) deep.starts[3 * listed + c] = start[c];
  deep.vertices[listed] = vertex;
  deep.places[vertex] = static_cast<uint16_t>(listed);
  return listed + 1;
}

void Swap(const DeepCloth& deep, size_t a, size_t b) {
  std::swap(deep.vertices[a], deep.vertices[b]);
  for (size_t c = 0; c < 3; ++c) std::swap(deep.starts[3 * a + c], deep.starts[3 * b + c]);
  std::swap(deep.places[deep.vertices[a]], deep.places[deep.vertices[b]]);
}

// Classes, a bit each, that something of the body touches; cloth of the others stays where it is.
uint8_t TouchingClasses(const format::BodyView& body) {
  if (body.touched_by == nullptr) return UINT8_MAX;
  uint8_t bits = 0;
  for (size_t v = 0; v < body.vertex_count; ++v) bits |= body.touched_by[v];
  return bits;
}

// Neighbours of the first `joined` of the `listed` vertices join them, whether they are listed or not. Returns how many
// have joined then.
size_t JoinRing(const ModelView& model, uint8_t touching, const DeepCloth& deep, size_t joined, size_t* listed,
                const Surface& surface) {
  const uint8_t* classes = model.body.touch_classes;
  const size_t before = joined, most = model.vertex_count < kMostDeep ? model.vertex_count : kMostDeep;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    bool beside = false;
    for (size_t k = 0; k < 3; ++k) beside |= deep.places[face[k]] < before;
    for (size_t k = 0; k < 3 && beside; ++k) {
      if (deep.places[face[k]] < joined) continue;
      if (deep.places[face[k]] == kNotDeep) {
        if (*listed == most || (classes != nullptr && (touching >> classes[face[k]] & 1u) == 0)) continue;
        *listed = ListAt(deep, *listed, face[k], surface.PositionOf(face[k]));
      }
      Swap(deep, joined++, deep.places[face[k]]);
    }
  }
  return joined;
}

// Those that have not joined after all rings leave the lists.
size_t JoinRings(const ModelView& model, const DeepCloth& deep, size_t joined, size_t listed, const Surface& surface) {
  const uint8_t touching = TouchingClasses(model.body);
  for (int ring = 0; ring < kRings; ++ring) joined = JoinRing(model, touching, deep, joined, &listed, surface);
  for (size_t i = joined; i < listed; ++i) deep.places[deep.vertices[i]] = kNotDeep;
  return joined;
}

// `mean`, and as much more along `move` as it takes to be as long as that along it.
Vec NoLess(Vec move, Vec mean) {
  const double squared = Dot(move, move), share = squared > 0 ? Dot(mean, move) / squared : 1;
  return share < 1 ? mean + (1 - share) * move : mean;
}

// Vertices give way by their share in `under`, each no less than its own of `moves`.
void Smooth(const ModelView& model, const DeepCloth& deep, size_t listed, size_t triangles, const float* moves,
            const Surface& surface) {
  for (int k = 0; k < kSmoothings; ++k) {
    SumMoves(model, deep.places, deep.starts, deep.triangles, triangles, surface, deep.vertices, listed, deep.sums);
    for (size_t i = 0; i < listed; ++i) {
      const float* sum = deep.sums + 4 * i;
      if (!(sum[3] > 0)) continue;
      const Vec mean = (deep.under[i] / (kWhole * static_cast<double>(sum[3]))) * VecAt(sum);
      Put(StartOf(deep, i) + NoLess(VecAt(moves + 3 * i), mean), surface.PositionOf(deep.vertices[i]));
    }
  }
}

// In `under`: 0 where a vertex moved by `least`, kWhole from twice that on; and of each the largest in kRings around.
void FillShares(const ModelView& model, const DeepCloth& deep, size_t listed, size_t triangles, double least,
                const Surface& surface) {
  for (size_t i = 0; i < listed; ++i) {
    const Vec move = MoveAt(deep, surface, i);
    const double over = std::sqrt(Dot(move, move)) / least - 1;
    deep.under[i] = static_cast<uint32_t>(kWhole * (over < 0 ? 0 : over < 1 ? over : 1));
    deep.patches[i] = static_cast<uint16_t>(deep.under[i]);
  }
  for (int ring = 0; ring < kRings; ++ring) {
    for (size_t t = 0; t < triangles; ++t) {
      const uint16_t* face = model.faces + size_t{3} * deep.triangles[t];
      uint32_t largest = 0;
      for (size_t k = 0; k < 3; ++k) {
        const uint16_t place = deep.places[face[k]];
        if (place < listed && deep.under[place] > largest) largest = deep.under[place];
      }
      for (size_t k = 0; k < 3; ++k) {
        const uint16_t place = deep.places[face[k]];
        if (place < listed && deep.patches[place] < largest) deep.patches[place] = static_cast<uint16_t>(largest);
      }
    }
    for (size_t i = 0; i < listed; ++i) deep.under[i] = deep.patches[i];
  }
}

}  // namespace

size_t SpreadMoves(const ModelView& model, const DeepCloth& deep, size_t moved, float* moves, const Surface& surface) {
  if (moved == 0) return 0;
  const size_t joined = JoinRings(model, deep, moved, moved, surface);
  for (size_t i = 0; i < joined; ++i) {
    Put(MoveAt(deep, surface, i), moves + 3 * i);
    deep.under[i] = static_cast<uint32_t>(kWhole);
  }
  const size_t triangles = ListTriangles(model, deep.places, deep.places, deep.triangles);
  Smooth(model, deep, joined, triangles, moves, surface);
  return joined;
}

size_t ListMove(const DeepCloth& deep, size_t listed, uint16_t vertex, const float* start, const Surface& surface) {
  if (deep.places[vertex] != kNotDeep || listed == kMostDeep) return listed;
  const Vec move = VecAt(surface.PositionOf(vertex)) - VecAt(start);
  return Dot(move, move) > 0 ? ListAt(deep, listed, vertex, start) : listed;
}

size_t CountListed(const ModelView& model, const DeepCloth& deep) {
  size_t listed = 0;
  for (size_t v = 0; v < model.vertex_count; ++v) listed += deep.places[v] == kNotDeep ? 0u : 1u;
  return listed;
}

size_t SpreadLongMoves(const ModelView& model, const DeepCloth& deep, size_t listed, double least, float* moves,
                       const Surface& surface) {
  size_t joined = 0;
  for (size_t i = 0; i < listed; ++i) {
    const Vec move = MoveAt(deep, surface, i);
    if (Dot(move, move) > least * least) Swap(deep, joined++, i);
  }
  if (joined == 0) return 0;
  joined = JoinRings(model, deep, joined, listed, surface);
  const size_t triangles = ListTriangles(model, deep.places, deep.places, deep.triangles);
  FillShares(model, deep, joined, triangles, least, surface);
  for (size_t i = 0; i < joined; ++i) {
    const Vec move = (deep.under[i] / kWhole) * MoveAt(deep, surface, i);
    Put(VecAt(surface.PositionOf(deep.vertices[i])) - move, deep.starts + 3 * i);
    Put(move, moves + 3 * i);
  }
  Smooth(model, deep, joined, triangles, moves, surface);
  return joined;
}

}  // namespace dcloth::engine
