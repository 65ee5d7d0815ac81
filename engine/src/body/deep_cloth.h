// Cloth that the network drew deep inside a limb is laid over the limb, before PushOut takes the rest out of the skin
// (NETWORK.md, "Cloth deep in a limb").
#ifndef DCLOTH_ENGINE_SRC_BODY_DEEP_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_DEEP_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/base/lent_memory.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/body/sleeves.h"
#include "engine/src/body/touch_lists.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// The most vertices of a frame that are laid anew; those after them stay. A thigh through the whole skirt takes 1,000.
constexpr size_t kMostDeep = 2048;
constexpr uint16_t kNotDeep = 0xFFFF;

// Scratch of a frame, but for the sleeves.
struct DeepCloth {
  Sleeves sleeves;
  uint16_t* places;     // [n], in the next; kNotDeep for cloth that stays
  uint16_t* vertices;   // [kMostDeep]
  uint16_t* patches;    // [kMostDeep], of the vertices in a core
  uint32_t* under;      // [kMostDeep], CoresUnder
  uint8_t* nearest;     // [kMostDeep], the core of the bone nearest in the bind pose, kMostCores where there is none
  uint32_t* triangles;  // [3 kMostDeep], which have such a vertex
  float* starts;        // [kMostDeep, 3], where they lay
  float* sums;          // [2, kMostDeep + 1, 4], SumMoves
  float* sides;         // [patches, 3], unit vectors out of the garment
};

DeepCloth PlaceDeepCloth(const format::ModelView& model, const Sleeves& sleeves, Arena* arena);

// `mirrored`: triangles turn the other way in the host's space. `swept`: cores, a bit each, that no cloth is behind:
// they have taken it along. Fills in `places` and `triangles`, and returns how many of the latter. `limbs` are posed.
// Cost for 8,000 vertices: 0.17 ms; where cloth is in a core another 0.15 ms, and 1 us a vertex that is moved.
size_t LayOverLimbs(const format::ModelView& model, bool mirrored, const LimbCores& limbs, uint32_t swept,
                    const TouchLists& lists, const DeepCloth& deep, const Surface& surface);

// Lists of `vertices`, of which `places` tells where in them each is: visit(vertex, count) for neighbours of the first
// `found` that are not listed. It says whether they join them; returns how many there are then.
template <typename Visit>
size_t AddRing(const format::ModelView& model, uint16_t* places, uint16_t* vertices, size_t found, Visit visit) {
  const size_t before = found, most = model.vertex_count < kMostDeep ? model.vertex_count : kMostDeep;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    bool beside = false;
    for (size_t k = 0; k < 3; ++k) beside |= places[face[k]] < before;
    for (size_t k = 0; k < 3 && beside && found < most; ++k) {
      if (places[face[k]] != kNotDeep || !visit(face[k], found)) continue;
      places[face[k]] = static_cast<uint16_t>(found);
      vertices[found++] = face[k];
    }
  }
  return found;
}

// The triangles of which a corner is in one of two lists of vertices; returns how many, at most 3 kMostDeep.
size_t ListTriangles(const format::ModelView& model, const uint16_t* places, const uint16_t* other_places,
                     uint32_t* triangles);

// `sums` [found, 4] of the `vertices`: of the moves of their neighbours since `starts` [found, 3], and how many
// neighbours there are, each as often as triangles share it. Behind them is scratch for the moves themselves.
void SumMoves(const format::ModelView& model, const uint16_t* places, const float* starts, const uint32_t* triangles,
              size_t triangle_count, const Surface& surface, const uint16_t* vertices, size_t found, float* sums);

// How far a vertex was moved, host units.
float MoveOf(const DeepCloth& deep, const Surface& surface, size_t vertex);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_DEEP_CLOTH_H_
