// The mesh graph N(i) of NETWORK.md as compressed rows.
#ifndef DCLOTH_CONVERTER_MESH_GRAPH_H_
#define DCLOTH_CONVERTER_MESH_GRAPH_H_

#include <cstdint>
#include <vector>

#include "converter/bundle.h"

namespace dcloth::converter {

// Row i is columns[row_starts[i], row_starts[i + 1]): i and the vertices it shares an edge with, ascending, each once.
struct MeshGraph {
  std::vector<uint32_t> row_starts;  // [n + 1]
  std::vector<uint16_t> columns;
};

// `faces` holds indices below vertex_count, at most 65535.
MeshGraph BuildMeshGraph(const Faces& faces, uint32_t vertex_count);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_MESH_GRAPH_H_
