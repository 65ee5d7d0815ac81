// The mesh that a texture is drawn on: vertices that lie at several places of it are repeated.
#ifndef DCLOTH_CONVERTER_TEXTURE_MESH_H_
#define DCLOTH_CONVERTER_TEXTURE_MESH_H_

#include <cstdint>
#include <vector>

#include "converter/bundle.h"

namespace dcloth::converter {

struct TextureMesh {
  Matrix coordinates;                   // [n + s, 2]
  std::vector<uint32_t> seam_vertices;  // [s], of the garment's: what vertex n + i repeats
  std::vector<uint32_t> faces;          // [c, 3], indices into `coordinates`

  bool empty() const { return faces.empty(); }
};

// Empty where the bundle has no texture coordinates. The garment's n vertices come first, in their order, so that what
// draws them draws this mesh by s copies more; each keeps the place of its first corner. Vertices without a face lie at
// 0, 0. Throws Error where n + s passes 65535. Cost: c log of the places of a vertex.
TextureMesh MakeTextureMesh(const Bundle& bundle);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_TEXTURE_MESH_H_
