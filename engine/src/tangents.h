// Vertex tangents of the skinned garment, from the host's texture coordinates.
#ifndef DCLOTH_ENGINE_SRC_TANGENTS_H_
#define DCLOTH_ENGINE_SRC_TANGENTS_H_

#include "engine/format/view.h"
#include "engine/src/output.h"

namespace dcloth::engine {

// xyz: the direction in which u grows, the triangles' (dP/du |det|) summed, made perpendicular to the normal
// and unit. w: 1 or -1, so that the bitangent is w cross(normal, tangent); `mirrored` as in Space. Run it
// after the normals and before FinishOutput. Does nothing where surface.tangents is null.
void RunTangents(const format::ModelView& model, bool mirrored, const dcloth_output& output, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_TANGENTS_H_
