#include "converter/texture_mesh.h"

#include <map>
#include <string>
#include <utility>

#include "converter/error.h"
#include "engine/format/limits.h"

namespace dcloth::converter {

TextureMesh MakeTextureMesh(const Bundle& bundle) {
  TextureMesh mesh;
  if (bundle.texture_coordinates.rows() == 0) return mesh;
  using Place = std::pair<float, float>;
  const uint32_t n = bundle.vertex_count();
  std::vector<Place> places(n);
  std::vector<std::map<Place, uint32_t>> drawn(n);  // of each vertex, by place
  for (Eigen::Index corner = 0; corner < bundle.template_faces.size(); ++corner) {
    const auto vertex = static_cast<uint32_t>(bundle.template_faces.data()[corner]);
    const Place place = {bundle.texture_coordinates(corner, 0), bundle.texture_coordinates(corner, 1)};
    const bool first = drawn[vertex].empty();
    const auto [at, fresh] = drawn[vertex].try_emplace(place, first ? vertex : static_cast<uint32_t>(places.size()));
    mesh.faces.push_back(at->second);
    if (first) {
      places[vertex] = place;
    } else if (fresh) {
      places.push_back(place);
      mesh.seam_vertices.push_back(vertex);
    }
  }
  if (places.size() > format::kMaxVertices) {
    throw Error({bundle.path, "template.texture_coordinates",
                 std::to_string(places.size()) + " vertices once seams are cut",
                 "at most " + std::to_string(format::kMaxVertices), "join the pieces of the texture's layout"});
  }
  mesh.coordinates.resize(static_cast<Eigen::Index>(places.size()), 2);
  for (size_t i = 0; i < places.size(); ++i)
    mesh.coordinates.row(static_cast<Eigen::Index>(i)) << places[i].first, places[i].second;
  return mesh;
}

}  // namespace dcloth::converter
