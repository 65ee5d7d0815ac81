// Cloth that the network drew deep inside a limb is laid over the limb, before PushOut takes the rest out of the skin
// (NETWORK.md, "Cloth deep in a limb").
#ifndef DCLOTH_ENGINE_SRC_BODY_DEEP_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_DEEP_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/base/lent_memory.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/body/touch_lists.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// The most vertices of a frame that are laid anew; those after them stay. A thigh through the whole skirt takes 1,000.
constexpr size_t kMostDeep = 2048;
constexpr uint16_t kNotDeep = 0xFFFF;

// Scratch of a frame.
struct DeepCloth {
  uint16_t* places;     // [n], in the next; kNotDeep for cloth that stays
  uint16_t* vertices;   // [kMostDeep]
  uint16_t* patches;    // [kMostDeep], of the vertices in a core
  uint32_t* under;      // [kMostDeep], CoresUnder
  uint8_t* nearest;     // [kMostDeep], the core of the bone nearest in the bind pose, kMostCores where there is none
  uint32_t* triangles;  // [3 kMostDeep], which have such a vertex
  float* starts;        // [kMostDeep, 3], where they lay
  float* sums;          // [kMostDeep, 4], of a vertex's neighbours' moves, and how many they are
  float* sides;         // [patches, 3], unit vectors out of the garment
};

DeepCloth PlaceDeepCloth(const format::ModelView& model, Arena* arena);

// `mirrored`: triangles turn the other way in the host's space. Fills in `places`. `limbs` are posed. Cost for
// 8,000 vertices: 0.17 ms; where cloth is in a core another 0.15 ms, and 1 us a vertex that is moved.
void LayOverLimbs(const format::ModelView& model, bool mirrored, const LimbCores& limbs, const TouchLists& lists,
                  const DeepCloth& deep, const Surface& surface);

// How far a vertex was moved, host units.
float MoveOf(const DeepCloth& deep, const Surface& surface, size_t vertex);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_DEEP_CLOTH_H_
