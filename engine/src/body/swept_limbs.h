// Limbs that went all the way through their cloth: where laying it over a limb tears it, it falls onto the limb from
// where that would wear it, or the limb is swept through it from a pose nearer to the bind pose, and takes it along.
// What that stretched is drawn together (NETWORK.md, "Limbs through cloth").
//
// Where its vertices are does not tell on which side of such a limb cloth belongs; how the limb wears it does.
#ifndef DCLOTH_ENGINE_SRC_BODY_SWEPT_LIMBS_H_
#define DCLOTH_ENGINE_SRC_BODY_SWEPT_LIMBS_H_

#include <cstdint>

#include "engine/src/base/lent_memory.h"
#include "engine/src/body/deep_cloth.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/body/sleeves.h"
#include "engine/src/body/touch_lists.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

struct SweptCloth {
  uint8_t* limbs;      // [n], a bit for each limb under a garment vertex; found once for each body
  uint16_t* places;    // [n], in the next; kNotDeep for cloth that was not swept along. Scratch of a frame, as the next
  uint16_t* vertices;  // [kMostDeep]
  float* starts;       // [kMostDeep, 3], where they lay
};

// The model has a body.
SweptCloth PlaceSweptCloth(const format::ModelView& model, Arena* arena);

// Lists vertex `v`, which lies at `start`, behind `found` others; returns how many there are then.
inline size_t List(const SweptCloth& swept, size_t found, uint16_t v, const float* start) {
  for (size_t c = 0; c < 3; ++c) swept.starts[3 * found + c] = start[c];
  swept.vertices[found] = v;
  swept.places[v] = static_cast<uint16_t>(found);
  return found + 1;
}

// Once for each body, after FindSleeves: cloth that goes around a limb as a sleeve does is not swept along by it. Cost:
// 1 ms for 10,000 vertices.
void FindSweptCloth(const format::ModelView& model, const LimbCores& limbs, const Sleeves& sleeves,
                    const SweptCloth& swept);

// LayOverLimbs, and again after each try to put on anew what it tore on a limb. `matrices` [joint_count, 12] take the
// bind pose to the host's space; `limbs` are posed. Returns the limbs that laying left torn or pierced, mended since
// or not, a bit of VisitLimbs each. Cost beyond LayOverLimbs, 10,000 vertices: 0.05 ms where that found cloth in a
// core, 3 ms a try, of which a frame has five at most, and 2 to 5 ms where cloth is drawn together.
uint8_t LayOrSweep(const format::ModelView& model, bool mirrored, const float* matrices, const LimbCores& limbs,
                   const TouchLists& lists, const DeepCloth& deep, const SweptCloth& swept, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_SWEPT_LIMBS_H_
