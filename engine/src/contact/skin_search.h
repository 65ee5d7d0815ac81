// The point of the posed skin that is closest to a point of the garment, by a walk over the skin's vertices.
#ifndef DCLOTH_ENGINE_SRC_CONTACT_SKIN_SEARCH_H_
#define DCLOTH_ENGINE_SRC_CONTACT_SKIN_SEARCH_H_

#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/base/vec.h"

namespace dcloth::engine {

constexpr uint16_t kNotNear = 0xFFFF;  // in place of a body vertex, where the skin is far

struct PosedSkin {
  const format::BodyView* body;
  const float* positions;  // [b, 3]
  const float* normals;    // [b, 3] of its vertices, outward
  uint8_t touch_bit;       // faces count whose corners all have it in body->touched_by; 0: all faces
};

struct ClosestSkin {
  Vecf outward;         // unit: of the point from the surface, or the surface's own where they touch
  float height;         // over the surface, below 0 under it
  uint16_t vertex;      // a corner of its face
  uint32_t faces_seen;  // on the way, each as often as it was looked at: what the search took
  bool found;           // false where no face around has an area
  bool on_rim;          // the faces that count end there, an arm's at the shoulder say: nothing is under a surface
};

// Walks from each of two vertices, which may lie on two limbs, to neighbours that are nearer, at most kMostSteps times,
// and looks at the faces around the last ones: at most 2 (kMostSteps + 1) kMaxBodyRing faces. Cost: some 10 ns a face.
constexpr int kMostSteps = 8;
ClosestSkin FindClosestSkin(const PosedSkin& skin, uint16_t first, uint16_t second, Vecf point);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CONTACT_SKIN_SEARCH_H_
