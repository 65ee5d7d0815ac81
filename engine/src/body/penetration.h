// Keeps the drawn garment out of the body (NETWORK.md, "Penetration"; D-Cloth eq. 18).
#ifndef DCLOTH_ENGINE_SRC_BODY_PENETRATION_H_
#define DCLOTH_ENGINE_SRC_BODY_PENETRATION_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/base/lent_memory.h"
#include "engine/src/body/body_search.h"
#include "engine/src/body/body_sites.h"
#include "engine/src/body/deep_cloth.h"
#include "engine/src/body/hitched_cloth.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/body/swept_limbs.h"
#include "engine/src/body/touch_lists.h"
#include "engine/src/draw/output.h"
#include "engine/src/pose/pose.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

// Scratch of a frame but for what is found once for each body; all null where the model has no body.
struct BodyMemory {
  float* matrices;   // [joint_count, 12]
  float* positions;  // [b, 3] posed
  float* normals;    // [b, 3]
  BodySites sites;
  TouchLists touch;      // once
  LimbCores limbs;       // measured once, posed in each frame
  SweptCloth swept;      // its limbs once
  DeepCloth deep;        // its sleeves once
  HitchedCloth hitched;  // its edges once; its scratch is that of `sites`
  float* tops;           // [b] for LiftOverLining
  uint16_t* beside;      // [n] for what comes after the pushes
};

BodyMemory PlaceBodyMemory(const format::ModelView& model, Arena* arena);

// Once, before the first KeepOutside: fills in `touch`, measures `limbs`, finds sleeves, the limbs of `swept`
// and the edges of `hitched`.
void OrderGarment(const format::ModelView& model, const BodyMemory& memory);

// Moves each vertex of `surface` that is less than the clearance outside the closest point of what it touches of the
// posed body until it is just that; one whose closest point is where that ends stays. Run it after skinning, while
// positions are relative to the hips. What lies between vertices is lifted out too where it would show. Does nothing
// where the model has no body.
void KeepOutside(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                 const SkinPose& skin, const BodyMemory& memory, const Surface& surface);

// What the searches of a frame may take together, so that no pose and no model makes a frame endless: 16 ns a face. A
// vertex that comes after stays where it is. The bundled garments look at 20 faces a vertex at most where they lie on
// the floor or turn over, at 1.7 in most clips; joints shuffled or torn apart would have them look at 126, joints
// without size at 219.
struct SearchBudget {
  uint32_t faces;
  uint32_t whole_searches;  // pushes beyond them go by walks
  uint32_t looks = 0;       // for suspects; patches beyond them have none (NearestJob::looks)
};

// Of a garment of so many vertices. A body can be made of which every group of sites is as near to every vertex, a
// ball: looks of 65,535 vertices then take 0.11 s (AVX2, scalar; SSE4 0.26), without a bound 0.50 to 1.95. The bundled
// garments take 10 a vertex at most as they move, 56 as the scalar source counts, 55 and 256 with joints torn apart or
// of no size. A model can be made in which every push is far and every face in question; the bundled garments take 584
// whole searches at most in the two clips beside them, 1,477 in a dance, and all in the wildest frames of a roundhouse
// kick.
inline SearchBudget SearchBudgetOf(uint32_t vertices) {
  constexpr uint32_t kFacesPerVertex = 32, kLeastFaces = 65536, kWholeSearches = 2048;
  constexpr uint32_t kLooksPerVertex = 256, kLeastLooks = 1 << 18;
  const uint32_t faces = kFacesPerVertex * vertices, looks = kLooksPerVertex * vertices;
  return {faces > kLeastFaces ? faces : kLeastFaces, kWholeSearches, looks > kLeastLooks ? looks : kLeastLooks};
}

// Point `i` of the job, which has a suspect, out of what its class touches and `clearance` away from it; less in a fold
// that is too narrow. Where the closest point lies on the rim of what counts, out of the skin beyond it if the point is
// just under that, else not at all. `position` is the point's; `far_moved` says that it was laid elsewhere, so that its
// nearest site may tell nothing; `budget` is what is left in the frame. Returns a body vertex beside the last closest
// point that is not on the rim, or kNotNear.
uint16_t PushOut(const PosedBody& posed, const kernels::NearestJob& job, const TouchLists& lists, size_t i,
                 double clearance, bool far_moved, SearchBudget* budget, float* position);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_PENETRATION_H_
