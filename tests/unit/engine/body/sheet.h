// A level square of cloth, its middle at the origin.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_BODY_SHEET_H_
#define DCLOTH_TESTS_UNIT_ENGINE_BODY_SHEET_H_

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/format/view.h"

namespace dcloth::engine {

struct Sheet {
  Sheet(size_t side, float spacing) {
    const float middle = 0.5f * static_cast<float>(side - 1);
    for (size_t r = 0; r < side; ++r) {
      for (size_t c = 0; c < side; ++c) {
        positions.insert(positions.end(),
                         {spacing * (static_cast<float>(c) - middle), 0, spacing * (static_cast<float>(r) - middle)});
        if (r + 1 == side || c + 1 == side) continue;
        const auto a = static_cast<uint16_t>(r * side + c), below = static_cast<uint16_t>(a + side);
        const uint16_t corners[4] = {a, static_cast<uint16_t>(a + 1), below, static_cast<uint16_t>(below + 1)};
        for (const int corner : {0, 2, 1, 1, 2, 3}) faces.push_back(corners[corner]);
      }
    }
  }

  size_t count() const { return positions.size() / 3; }

  void ShowTo(format::ModelView* model) const {
    model->vertex_count = static_cast<uint32_t>(count());
    model->triangle_count = static_cast<uint32_t>(faces.size() / 3);
    model->faces = faces.data();
  }

  // Of a vertex from a place, level.
  float AwayFrom(float x, float z, size_t vertex) const {
    return std::hypot(positions[3 * vertex] - x, positions[3 * vertex + 2] - z);
  }

  std::vector<float> positions;
  std::vector<uint16_t> faces;
};

}  // namespace dcloth::engine

#endif  // DCLOTH_TESTS_UNIT_ENGINE_BODY_SHEET_H_
