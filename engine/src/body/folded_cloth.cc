#include "engine/src/body/folded_cloth.h"

#include <cstddef>
#include <limits>

#include "engine/src/body/deep_cloth.h"
#include "engine/src/body/limb_cores.h"

namespace dcloth::engine {
namespace {

// Clearances: lining that is higher hangs free, and cloth that would have to go further was given up deep in the body.
constexpr float kHighest = 8;
constexpr float kNone = std::numeric_limits<float>::lowest();  // in place of a height, where no lining is turned out

// Of a vertex over the plane at the body vertex beside it.
float HeightOf(const PosedBody& posed, const float* normals, uint16_t beside, const float* position) {
  const float *foot = posed.positions + size_t{3} * beside, *normal = normals + size_t{3} * beside;
  const float over[3] = {position[0] - foot[0], position[1] - foot[1], position[2] - foot[2]};
  return Dot(over, normal);
}

// Of the triangle, as its outer side turns.
void FillNormal(const Surface& surface, const uint16_t* face, float* normal) {
  const float *a = surface.PositionOf(face[0]), *b = surface.PositionOf(face[1]), *p = surface.PositionOf(face[2]);
  const float ab[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]}, ac[3] = {p[0] - a[0], p[1] - a[1], p[2] - a[2]};
  Cross(ab, ac, normal);
}

}  // namespace

size_t LiftOverLining(const format::ModelView& model, const PosedBody& posed, const float* normals,
                      const uint16_t* beside, double clearance, uint16_t* places, float* tops, const Surface& surface) {
  constexpr uint16_t kLining = 1, kLifted = 0;
  const format::BodyView& body = *posed.body;
  const auto gap = static_cast<float>(clearance);
  const float most = kHighest * gap;
  for (size_t v = 0; v < model.vertex_count; ++v) places[v] = kNotDeep;
  for (size_t b = 0; b < body.vertex_count; ++b) tops[b] = kNone;
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* face = model.faces + 3 * t;
    float normal[3];
    FillNormal(surface, face, normal);
    for (size_t k = 0; k < 3; ++k) {
      const uint16_t site = beside[face[k]];
      if (site == kNotNear || places[face[k]] != kNotDeep) continue;
      const float out = static_cast<float>(posed.outward) * Dot(normal, normals + size_t{3} * site);
      if (!(out < 0)) continue;
      const float height = HeightOf(posed, normals, site, surface.PositionOf(face[k]));
      if (!(height <= most)) continue;
      places[face[k]] = kLining;
      for (uint32_t i = body.row_starts[site]; i < body.row_starts[site + 1]; ++i) {
        const uint16_t* skin = body.faces + size_t{3} * body.columns[i];
        for (size_t c = 0; c < 3; ++c) tops[skin[c]] = height > tops[skin[c]] ? height : tops[skin[c]];
      }
    }
  }
  size_t lifted = 0;
  for (size_t v = 0; v < model.vertex_count; ++v) {
    const uint16_t site = beside[v];
    const bool lining = places[v] == kLining;
    places[v] = kNotDeep;
    if (site == kNotNear || lining) continue;
    float* position = surface.PositionOf(v);
    const float lift = tops[site] + gap - HeightOf(posed, normals, site, position);
    if (!(lift > 0) || lift > most) continue;
    for (size_t c = 0; c < 3; ++c) position[c] += lift * normals[size_t{3} * site + c];
    places[v] = kLifted;
    ++lifted;
  }
  return lifted;
}

}  // namespace dcloth::engine
