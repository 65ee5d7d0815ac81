// Moves a point of the garment out of the posed body (NETWORK.md, "Penetration").
#ifndef DCLOTH_ENGINE_SRC_PUSH_OUT_H_
#define DCLOTH_ENGINE_SRC_PUSH_OUT_H_

#include <cstddef>

#include "engine/src/body_search.h"

namespace dcloth::engine {

// Point `i` of the job, which has a suspect, out of what its class touches and `clearance` away from it; less in a fold that
// is too narrow, and not at all where the closest point lies on the rim of what counts. `position` is the point's.
void PushOut(const PosedBody& posed, const kernels::NearestJob& job, const TouchLists& lists, size_t i, double clearance,
             float* position);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_PUSH_OUT_H_
