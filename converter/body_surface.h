// The part of the character's skin that cloth is kept out of, as the model file wants it (schema, Body).
#ifndef DCLOTH_CONVERTER_BODY_SURFACE_H_
#define DCLOTH_CONVERTER_BODY_SURFACE_H_

#include <cstdint>
#include <vector>

#include "converter/bundle.h"
#include "converter/prune.h"

namespace dcloth::converter {

// All empty where no skin collides.
struct BodySurface {
  std::vector<uint32_t> vertices;    // [b] index in the bundle; 16 in a row lie close together
  std::vector<uint32_t> faces;       // [f, 3] index into `vertices`
  std::vector<uint32_t> row_starts;  // [b + 1]
  std::vector<uint32_t> columns;     // [3 f] faces around each vertex
  PrunedWeights skin;                // columns index bundle.joint_names
  // Both empty where the bundle has no masks.
  std::vector<uint8_t> touch_classes;  // [n] class of each garment vertex
  std::vector<uint8_t> touched_by;     // [b] bit c: touched by class c

  bool empty() const { return vertices.empty(); }
};

// A face belongs to the surface when all its corners collide and one lies within kBodyReach of the template, at bind.
// Which vertices collide is the bundle's body.collides; without it those that the cloth bones alone carry, so that no
// joint is needed for them that the garment does not need anyway. With template.touches and body.parts each of the
// garment's masks is a class, and faces that no class shares a bit with in all three corners are left out. Throws Error
// where there are more classes, or body.collides marks more, than the format holds; without it such a body is left out.
constexpr double kBodyReach = 0.5;  // metres
BodySurface MakeBodySurface(const Bundle& bundle, uint32_t influences);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_BODY_SURFACE_H_
