// The faces of the posed body that some triangles of the garment may cross, by boxes and planes of its sites.
#ifndef DCLOTH_ENGINE_SRC_BODY_NEAR_FACES_H_
#define DCLOTH_ENGINE_SRC_BODY_NEAR_FACES_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/body/body_sites.h"
#include "engine/src/body/touch_lists.h"
#include "engine/src/draw/output.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

struct Box {
  float low[3], high[3];

  void Hold(const float* lowest, const float* highest) {
    for (size_t c = 0; c < 3; ++c) {
      low[c] = lowest[c] < low[c] ? lowest[c] : low[c];
      high[c] = highest[c] > high[c] ? highest[c] : high[c];
    }
  }
};

// Triangles of the garment that follow each other, which share the groups of sites near them.
struct TriangleBatch {
  static constexpr size_t kMost = 8;

  const uint16_t* faces[kMost];
  size_t count;
  Box boxes[kMost];
  uint16_t groups[kernels::kMaxNearestGroups];
  size_t group_count;
};

class NearFaces {
 public:
  // `positions` [b, 3]; `sites` are filled in.
  NearFaces(const format::BodyView& body, const BodySites& sites, const TouchLists& lists, float clearance)
      : body_(body),
        sites_(sites),
        lists_(lists),
        clearance_(clearance),
        stride_(kernels::NearestBoundStride(sites.groups)) {}

  // The boxes of the triangles, and the groups near any. Returns what this and Each take beside visits, in faces.
  uint32_t FindGroups(const Surface& surface, TriangleBatch* batch) const;

  // visit(corners) once for each face that triangle `index` may cross: such a face has each corner at a site that is
  // within the longest edge there of the triangle's box, and the triangle is not above the plane over all faces there.
  template <typename Visit>
  void Each(const Surface& surface, const TriangleBatch& batch, size_t index, Visit visit) const {
    for (size_t g = 0; g < batch.group_count; ++g) {
      bool may[kernels::kNearestGroup];
      if (!MayCross(surface, batch, index, batch.groups[g], may)) continue;
      size_t last = body_.vertex_count;  // the last vertex fills a group up
      for (size_t k = 0; k < kernels::kNearestGroup; ++k) {
        if (!may[k]) continue;
        const size_t vertex = BodyVertexAt(body_, lists_, batch.groups[g] * kernels::kNearestGroup + k);
        if (vertex == last) continue;
        last = vertex;
        for (uint32_t i = body_.row_starts[vertex]; i < body_.row_starts[vertex + 1]; ++i) {
          const uint16_t* corners = body_.faces + size_t{3} * body_.columns[i];
          if (corners[0] == vertex) visit(corners);
        }
      }
    }
  }

 private:
  bool MayCross(const Surface& surface, const TriangleBatch& batch, size_t index, size_t group,
                bool (&may)[kernels::kNearestGroup]) const;

  const format::BodyView& body_;
  const BodySites& sites_;
  const TouchLists& lists_;
  float clearance_;
  size_t stride_;
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_NEAR_FACES_H_
