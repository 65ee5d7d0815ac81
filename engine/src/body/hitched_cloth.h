// Cloth that a limb went through, and that laying does not bring over it, slides along itself until its edge is past
// the limb, as a skirt is hitched up by a shank that is set across the other leg (NETWORK.md, "Limbs out of cloth").
#ifndef DCLOTH_ENGINE_SRC_BODY_HITCHED_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_HITCHED_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/base/lent_memory.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/body/swept_limbs.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// A step of a vertex: by `part` of the way to the place `share` along the stretch between two of its neighbours.
struct SlideStep {
  uint16_t ends[2];
  float share, part;
};

struct HitchedCloth {
  uint8_t* at_edge;  // [n], 1 for vertices of the garment's edges; found once for each garment
  float* drawn;      // [n, 3], before LayOrSweep. Scratch of a frame, as the next
  SlideStep* steps;  // [n]
};

// The scratch alone. The model has a body.
HitchedCloth PlaceHitchedCloth(const format::ModelView& model, Arena* arena);

// Once for each garment. Cost: 0.05 ms for 16,000 triangles.
void FindEdges(const format::ModelView& model, const HitchedCloth& hitched);

// Where the cloth lies now. Cost: 0.02 ms for 8,000 vertices.
void KeepDrawn(const format::ModelView& model, const HitchedCloth& hitched, const Surface& surface);

// Where one of the limbs `torn`, a bit of VisitLimbs each, comes out of the cloth as it was laid since KeepDrawn, all
// cloth goes back to where it was, and there slides from the garment's nearest edge on, by 0.35 m at most. It is to
// be laid anew then. Returns whether it did; else nothing moves. `mirrored`: triangles turn the other way in the host's
// space. `limbs` are posed. Cost for 16,000 triangles: 1 ms a torn limb, and 2.5 ms more where one comes out.
bool HitchUp(const format::ModelView& model, bool mirrored, const LimbCores& limbs, uint8_t torn,
             const SweptCloth& swept, const HitchedCloth& hitched, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_HITCHED_CLOTH_H_
