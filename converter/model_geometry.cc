#include "converter/model_geometry.h"

#include <algorithm>
#include <array>
#include <utility>

#include "converter/error.h"
#include "engine/format/diagnostic.h"
#include "engine/format/verify.h"
#include "engine/format/view.h"

namespace dcloth::converter {

ModelGeometry GeometryOf(std::span<const std::byte> model) {
  constexpr size_t kInfluences = 4;
  dcloth_error error{};
  error.struct_size = sizeof(error);
  format::Diagnostic diagnostic(&error);
  format::ModelView view;
  if (!format::Verify(model.data(), model.size(), &view, &diagnostic))
    throw Error({.path = {}, .tensor = {}, .found = error.text, .expected = "a .dcloth model", .mend = {}});
  ModelGeometry geometry;
  const auto* const positions = view.template_positions;
  geometry.template_positions.assign(positions, positions + size_t{3} * view.vertex_count);
  const format::BodyView& body = view.body;
  if (body.vertex_count == 0) return geometry;
  geometry.body.assign(body.positions, body.positions + size_t{3} * body.vertex_count);
  geometry.body_triangles.assign(body.faces, body.faces + size_t{3} * body.face_count);
  for (size_t v = 0; v < body.vertex_count; ++v) {
    std::vector<std::pair<float, uint16_t>> held;
    for (size_t k = v * body.influences; k < (v + 1) * body.influences; ++k)
      held.emplace_back(body.weights[k], body.joints[k]);
    std::ranges::sort(held, [](const auto& a, const auto& b) { return a.first > b.first; });
    held.resize(kInfluences, {0.0f, uint16_t{0}});
    float sum = 0;
    for (const auto& [weight, joint] : held) sum += weight;
    for (const auto& [weight, joint] : held) {
      geometry.body_joints.push_back(joint);
      geometry.body_weights.push_back(weight / sum);
    }
  }
  return geometry;
}

}  // namespace dcloth::converter
