// Cloth in folds on a limb: pushed out of the skin, all its layers lie equally high, and the lining of one shows
// through the next (NETWORK.md, "Folds").
#ifndef DCLOTH_ENGINE_SRC_BODY_FOLDED_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_FOLDED_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/body/body_search.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// Lifts cloth that has its outer side out to a clearance above the lining that is turned out at the same skin. Returns
// how many vertices that are; they may be under other skin then.
//   posed    which body
//   normals  [b, 3] of the posed body
//   beside   [n] a body vertex beside the closest point of each vertex near the skin; kNotNear for those that stay
//   places   [n], filled in: kNotDeep for all that stay
//   tops     [b], scratch
// Cost for 19,000 triangles: 0.26 ms.
size_t LiftOverLining(const format::ModelView& model, const PosedBody& posed, const float* normals,
                      const uint16_t* beside, double clearance, uint16_t* places, float* tops, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_FOLDED_CLOTH_H_
