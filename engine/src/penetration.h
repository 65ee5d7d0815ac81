// Keeps the drawn garment out of the body (NETWORK.md, "Penetration"; D-Cloth eq. 18).
#ifndef DCLOTH_ENGINE_SRC_PENETRATION_H_
#define DCLOTH_ENGINE_SRC_PENETRATION_H_

#include "engine/src/arena.h"
#include "engine/src/body_sites.h"
#include "engine/src/output.h"
#include "engine/src/pose.h"
#include "engine/src/touch_lists.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

// Scratch of a frame but for `touch`; all null where the model has no body.
struct BodyMemory {
  float* matrices;   // [joint_count, 12]
  float* positions;  // [b, 3] posed
  float* normals;    // [b, 3]
  BodySites sites;
  TouchLists touch;
};

BodyMemory PlaceBodyMemory(const format::ModelView& model, Arena* arena);

// Once, before the first KeepOutside: fills in `touch`.
void OrderGarment(const format::ModelView& model, const BodyMemory& memory);

// Moves each vertex of `surface` that is less than the clearance outside the closest point of what it touches of the
// posed body until it is just that; one whose closest point is where that ends stays. Run it after skinning, while
// positions are relative to the hips. Does nothing where the model has no body.
void KeepOutside(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                 const BoundPose& bound, const BodyMemory& memory, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_PENETRATION_H_
