// Cloth that a foot was drawn through goes with the foot, as a panel does that is kicked (NETWORK.md, "Feet through
// cloth").
#ifndef DCLOTH_ENGINE_SRC_BODY_KICKED_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_KICKED_CLOTH_H_

#include "engine/format/view.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/body/swept_limbs.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

// Where the end of a limb that bends comes out of the garment, through triangles that it lies under and at most 0.2 m
// before its tip, the cloth there is moved to beyond its skin, pleats too, and less and less of it around: along a foot
// that sticks out, away from the body over one that hangs down along the cloth. Returns whether one does.
// `mirrored`: triangles turn the other way in the host's space. `skin` [b, 3] and `limbs` are posed. Cost for 20,000
// triangles: 0.1 ms.
bool TakeAlong(const format::ModelView& model, bool mirrored, const float* skin, const LimbCores& limbs,
               const SweptCloth& swept, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_KICKED_CLOTH_H_
