#include "converter/mesh_graph.h"

#include <algorithm>
#include <utility>

namespace dcloth::converter {

MeshGraph BuildMeshGraph(const Faces& faces, uint32_t vertex_count) {
  std::vector<std::pair<uint16_t, uint16_t>> edges;
  edges.reserve(vertex_count + 6 * static_cast<size_t>(faces.rows()));
  for (uint32_t i = 0; i < vertex_count; ++i) edges.emplace_back(static_cast<uint16_t>(i), static_cast<uint16_t>(i));
  for (Eigen::Index face = 0; face < faces.rows(); ++face) {
    for (int corner = 0; corner < 3; ++corner) {
      const auto a = static_cast<uint16_t>(faces(face, corner));
      const auto b = static_cast<uint16_t>(faces(face, (corner + 1) % 3));
      edges.emplace_back(a, b);
      edges.emplace_back(b, a);
    }
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());

  MeshGraph graph;
  graph.row_starts.assign(vertex_count + 1, 0);
  for (const auto& [from, to] : edges) {
    ++graph.row_starts[from + 1u];
    graph.columns.push_back(to);
  }
  for (uint32_t i = 0; i < vertex_count; ++i) graph.row_starts[i + 1] += graph.row_starts[i];
  return graph;
}

}  // namespace dcloth::converter
