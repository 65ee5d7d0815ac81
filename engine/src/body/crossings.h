// Triangles of cloth that cross the skin though their vertices lie outside: a toe through the middle of one, an edge
// over the side of a knee. They are found exactly and pushed out (NETWORK.md, "Cloth that still crosses the skin").
#ifndef DCLOTH_ENGINE_SRC_BODY_CROSSINGS_H_
#define DCLOTH_ENGINE_SRC_BODY_CROSSINGS_H_

#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/body/body_search.h"
#include "engine/src/body/body_sites.h"
#include "engine/src/body/deep_cloth.h"
#include "engine/src/body/touch_lists.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// The body of a frame, and what is known of the garment beside it.
struct CrossedBody {
  PosedBody posed;         // the touch bits of each triangle are taken in place of its own
  const float* normals;    // [b, 3]
  const BodySites& sites;  // filled in
  const TouchLists& lists;
  const uint16_t* beside;  // [n] a body vertex beside the closest point of each vertex near the skin, or kNotNear
  double clearance;        // host units
};

// Pushes triangles that cross faces which one of their corners touches along the normals of those, and the cloth around
// them less and less, so that a push is a fold and no spike. What a few pushes do not bring out stays where it was:
// cloth that is in a tangle with the body only gets crumpled by more. `deep` and `moves` [kMostDeep, 3] are scratch.
// Takes what it looks at from `faces`, at most half; where that is not enough, all stays. Returns how many vertices
// were moved, under other skin perhaps; they are in `deep.vertices`, where they were in `deep.starts`. Cost for 9,700
// vertices: 0.26 ms where nothing crosses, 1 to 6 ms where cloth is in tangles.
size_t Uncross(const format::ModelView& model, const CrossedBody& body, const DeepCloth& deep, float* moves,
               const Surface& surface, uint32_t* faces);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_CROSSINGS_H_
