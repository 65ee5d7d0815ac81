// Vertex normals of the skinned garment, and tangents from texture coordinates.
#ifndef DCLOTH_ENGINE_SRC_DRAW_NORMALS_H_
#define DCLOTH_ENGINE_SRC_DRAW_NORMALS_H_

#include "engine/src/draw/output.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

// Run it while positions are relative to the hips: ten kilometres out, world floats are a millimetre apart and normals
// from them would be noise. Does nothing where surface.normals is null.
void RunNormals(const kernels::KernelTable& kernels, const DrawnMesh& mesh, const Surface& surface);

// xyz: the direction in which u grows, the triangles' (dP/du |det|) summed, made perpendicular to the normal
// and unit. w: 1 or -1, so that the bitangent is w cross(normal, tangent); `mirrored` as in Space. Run it
// after the normals and before FinishOutput. `texture` stands in for coordinates that the output does not give. Does
// nothing where surface.tangents is null.
void RunTangents(const kernels::KernelTable& kernels, const DrawnMesh& mesh, bool mirrored, const float* texture,
                 const dcloth_output& output, const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_DRAW_NORMALS_H_
