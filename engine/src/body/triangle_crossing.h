// Two triangles that cross, one of cloth and one of skin.
#ifndef DCLOTH_ENGINE_SRC_BODY_TRIANGLE_CROSSING_H_
#define DCLOTH_ENGINE_SRC_BODY_TRIANGLE_CROSSING_H_

#include <cmath>

#include "engine/src/body/vec.h"

namespace dcloth::engine {

struct Triangle {
  Vec corners[3];
  Vec normal;  // not of unit length

  void FillNormal() { normal = Cross(corners[1] - corners[0], corners[2] - corners[0]); }
};

// Heights of each one's corners over the other's plane, times the length of that one's normal.
struct Crossing {
  double of_cloth[3], of_skin[3];
};

// Fills in the heights of `corners` over a triangle's plane; false where all lie on one side of it.
inline bool AreOnBothSides(const Triangle& plane, const Vec (&corners)[3], double (&heights)[3]) {
  bool above = false, below = false;
  for (int k = 0; k < 3; ++k) {
    heights[k] = Dot(plane.normal, corners[k] - plane.corners[0]);
    above |= heights[k] > 0;
    below |= heights[k] < 0;
  }
  return above && below;
}

// Whether an edge between `corners` passes through `face`, over whose plane they have `heights`.
inline bool HasEdgeThrough(const Triangle& face, const Vec (&corners)[3], const double (&heights)[3]) {
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    if (!(heights[k] < 0 ? heights[next] >= 0 : heights[next] < 0)) continue;
    const double share = heights[k] / (heights[k] - heights[next]);
    const Vec at = corners[k] + share * (corners[next] - corners[k]);
    bool inside = true;
    for (int e = 0; e < 3 && inside; ++e) {
      const Vec from = face.corners[e], along = face.corners[(e + 1) % 3] - from;
      inside = Dot(Cross(along, at - from), face.normal) >= 0;
    }
    if (inside) return true;
  }
  return false;
}

// The normal of `cloth` is filled in; the one of `skin` is where they cross. Triangles in one plane do not.
inline bool DoCross(const Triangle& cloth, Triangle* skin, Crossing* crossing) {
  if (!AreOnBothSides(cloth, skin->corners, crossing->of_skin)) return false;
  skin->FillNormal();
  if (!AreOnBothSides(*skin, cloth.corners, crossing->of_cloth)) return false;
  return HasEdgeThrough(*skin, cloth.corners, crossing->of_cloth) ||
         HasEdgeThrough(cloth, skin->corners, crossing->of_skin);
}

// How far cloth has to go along `out`, the unit normal of the skin outward, until all of it is above the skin's plane
// or all of the skin is under its own, whichever is nearer. `length`: of the skin's normal, below 0 if that one points
// inward.
inline double LiftOf(const Crossing& crossing, const Triangle& cloth, Vec out, double length) {
  double under = 0, over = 0;
  const double rise = Dot(cloth.normal, out);  // of the cloth's plane, times the length of its normal
  for (int k = 0; k < 3; ++k) {
    const double depth = -crossing.of_cloth[k] / length;
    const double height = rise > 0 ? crossing.of_skin[k] : -crossing.of_skin[k];
    under = depth > under ? depth : under;
    over = height > over ? height : over;
  }
  const double tilted = std::fabs(rise);
  return over < tilted * under ? over / tilted : under;
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_TRIANGLE_CROSSING_H_
