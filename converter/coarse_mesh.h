// The mesh that is drawn at a distance: half of the garment's vertices, where they are.
#ifndef DCLOTH_CONVERTER_COARSE_MESH_H_
#define DCLOTH_CONVERTER_COARSE_MESH_H_

#include <cstdint>
#include <vector>

#include "converter/bundle.h"

namespace dcloth::converter {

struct CoarseMesh {
  std::vector<uint32_t> vertices;  // rising, of the garment's
  std::vector<uint32_t> faces;     // [t, 3], indices into `vertices`

  bool empty() const { return faces.empty(); }
};

// Merges vertices into neighbours until `kept` are left, in the order of the quadric errors of M. Garland and
// P. Heckbert, "Surface Simplification Using Quadric Error Metrics", 1997; vertices that stay do not move, so the
// coarse mesh has the skin weights and displacements of the garment. Borders stay borders, no triangle turns over, and
// what is connected stays connected as it was. Vertices that share their place with another one stay, or a seam would
// open. Ends above `kept` where nothing more may merge; empty where nothing may at all. Cost: n log n.
CoarseMesh MakeCoarseMesh(const Matrix& positions, const Faces& faces, size_t kept);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_COARSE_MESH_H_
