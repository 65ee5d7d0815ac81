// Where a limb comes out of its cloth, by the way along its bones (NETWORK.md, "Feet through cloth" and "Limbs out of
// cloth").
#ifndef DCLOTH_ENGINE_SRC_BODY_PIERCED_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_PIERCED_CLOTH_H_

#include <cmath>
#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/body/swept_limbs.h"
#include "engine/src/body/vec.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

constexpr size_t kMostWayBones = 2;  // shank, foot

// A limb from its knee to its tip, the last one's as far as skin reaches.
struct LimbWay {
  Vec points[kMostWayBones + 2];
  const LimbCore* cores[kMostWayBones + 1];  // of the bone from each point to the next; the last one's twice
  size_t count;                              // of points
};

// Of the limb that begins with `upper`, as posed.
LimbWay WayOf(const LimbCores& limbs, const LimbCore& upper);

struct Exit {
  Vec at;           // in the host's space
  double left = 0;  // of the way to the tip; 0 where it does not come out
  size_t triangle;  // of the garment, that it comes out through
  size_t bone;      // of the way
};

// The furthest from the tip, by `furthest` host units at most, of those after which the limb does not go in again. It
// comes out where the tip is on the outer side of a triangle that the limb lies under, unless it went in just before
// that: a limb that lies on cloth from outside dips into it. `mirrored`: triangles turn the other way in the host's
// space. Cost for 20,000 triangles: 0.1 ms near the tip, 1 ms for all of a limb.
Exit FindExit(const format::ModelView& model, bool mirrored, const LimbWay& way, double furthest, double scale,
              const SweptCloth& swept, uint8_t bit, const Surface& surface);

// Whether the limb lies under all corners.
inline bool IsOver(const SweptCloth& swept, uint8_t bit, const uint16_t* face) {
  return (swept.limbs[face[0]] & swept.limbs[face[1]] & swept.limbs[face[2]] & bit) != 0;
}

// Twice the vector area of the cloth over the limb within `near` of `middle`: pleats do not turn it. `at(vertex)` is a
// vertex's place.
template <typename At>
Vec AreaAround(const format::ModelView& model, Vec middle, double near, const SweptCloth& swept, uint8_t bit, At at) {
  Vec sum = {};
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    if (!IsOver(swept, bit, face)) continue;
    const Vec first = at(face[0]), apart = first - middle;
    if (Dot(apart, apart) < near * near) sum = sum + Cross(at(face[1]) - first, at(face[2]) - first);
  }
  return sum;
}

// A unit vector, or 0.
inline Vec Normalized(Vec vector) {
  const double length = std::sqrt(Dot(vector, vector));
  return length > 0 ? (1 / length) * vector : Vec{};
}

// 1 up to `from`, 0 from `to` on, and smooth.
inline double Fade(double x, double from, double to) {
  const double share = (to - x) / (to - from);
  return share > 1 ? 1 : share > 0 ? share * share * (3 - 2 * share) : 0;
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_PIERCED_CLOTH_H_
