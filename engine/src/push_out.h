// Moves a point of the garment out of the posed body (NETWORK.md, "Penetration").
#ifndef DCLOTH_ENGINE_SRC_PUSH_OUT_H_
#define DCLOTH_ENGINE_SRC_PUSH_OUT_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/body_search.h"

namespace dcloth::engine {

// Searches of the whole body in a frame; pushes beyond them go by walks, whose work kMaxBodyRing bounds. A model can be made
// in which every push is far and every face in question; the bundled garments need 421 at most on their held-out clips.
constexpr uint32_t kMostWholeSearches = 2048;

// Point `i` of the job, which has a suspect, out of what its class touches and `clearance` away from it; less in a fold that
// is too narrow, and not at all where the closest point lies on the rim of what counts. `position` is the point's;
// `whole_searches` are those left in the frame.
void PushOut(const PosedBody& posed, const kernels::NearestJob& job, const TouchLists& lists, size_t i, double clearance,
             uint32_t* whole_searches, float* position);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_PUSH_OUT_H_
