// The closest point of the posed body to a point of the garment, by a walk over the body's faces from a vertex near it.
#ifndef DCLOTH_ENGINE_SRC_BODY_BODY_SEARCH_H_
#define DCLOTH_ENGINE_SRC_BODY_BODY_SEARCH_H_

#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/body/touch_lists.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

constexpr uint16_t kNotNear = 0xFFFF;  // in place of a body vertex, where the skin is far

struct PosedBody {
  const format::BodyView* body;
  const float* positions;  // [b, 3]
  double outward;          // 1, or -1 where the space mirrors faces
  uint8_t touch_bit;       // faces count whose corners all have it in body->touched_by; 0: all faces
};

struct ClosestPoint {
  double point[3];
  double direction[3];  // unit, outward: of the point from the surface, or of the face where they touch
  double distance;      // below 0 under the surface
  uint32_t face;
  uint32_t faces_seen;  // on the way, each as often as it was looked at: what the search took
  uint8_t corners;      // of the face that the point lies between, bit by bit: one, two along an edge, or all
  bool found;           // false where all faces looked at have no area
};

// The nearer of two walks. A walk looks at the faces around its start, then around the corners of the best one as long
// as that is nearer, at most eight times; the one from `second` is spared where the one from `first` has looked around
// that vertex too. On an edge or corner that faces share, the one seen most squarely decides which side is outside.
ClosestPoint SearchBody(const PosedBody& posed, uint32_t first, uint32_t second, const double point[3]);

// The nearest of all faces around the sites of `job`: those of a walk from `start`, then around each vertex that may be
// a corner of a nearer one. Some microseconds, for the few points whose neighbourhood a vertex near them does not tell.
ClosestPoint SearchWholeBody(const PosedBody& posed, const kernels::NearestJob& job, const TouchLists& lists,
                             uint32_t start, const double point[3]);

// Whether the faces that count end at the closest point, an arm's at the shoulder say: nothing is under a surface
// there. False where all faces count.
bool EndsAt(const PosedBody& posed, const ClosestPoint& closest);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_BODY_SEARCH_H_
