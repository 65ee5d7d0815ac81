// Cloth around vertices that were moved gives way, so that a push is a fold and no spike, and a limb that was drawn
// through the cloth lifts it and is not printed on it (NETWORK.md, "Cloth that gives way").
#ifndef DCLOTH_ENGINE_SRC_BODY_SPREAD_MOVES_H_
#define DCLOTH_ENGINE_SRC_BODY_SPREAD_MOVES_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/body/deep_cloth.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// The first `moved` vertices of the lists of `deep` have moved since `starts`. Four rings of neighbours join them, but
// for cloth that touches nothing. Then each vertex takes the average move of its neighbours, twelve times, and a moved
// one no less along its own move than that. `moves` [kMostDeep, 3] is scratch. Returns how many are listed then. Cost:
// 0.2 ms for 20,000 triangles, and 0.15 us a vertex that is listed.
size_t SpreadMoves(const format::ModelView& model, const DeepCloth& deep, size_t moved, float* moves,
                   const Surface& surface);

// Lists a vertex that lay at `start`, if it has moved, is not listed, and there is room. Returns how many are listed.
size_t ListMove(const DeepCloth& deep, size_t listed, uint16_t vertex, const float* start, const Surface& surface);

// How many vertices LayOverLimbs has listed.
size_t CountListed(const format::ModelView& model, const DeepCloth& deep);

// Of the `listed` vertices some have moved further than `least`, host units: around them moves spread as above, those
// of the others too. Not at all around a vertex that moved by `least`, and wholly from twice that on: so cloth does not
// jump between two frames. Returns how many are listed then.
size_t SpreadLongMoves(const format::ModelView& model, const DeepCloth& deep, size_t listed, double least, float* moves,
                       const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_SPREAD_MOVES_H_
