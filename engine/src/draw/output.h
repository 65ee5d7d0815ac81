// Host buffers: what they must look like, where the garment is computed, and the last pass over it.
#ifndef DCLOTH_ENGINE_SRC_DRAW_OUTPUT_H_
#define DCLOTH_ENGINE_SRC_DRAW_OUTPUT_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"
#include "engine/format/view.h"
#include "engine/src/pose/space.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

// Float arrays that the garment is computed in: the host's own buffers where all of them hold floats, else
// its scratch.
struct Surface {
  float* positions;
  size_t position_stride_bytes;
  float* normals;  // null when not wanted
  size_t normal_stride_bytes;
  float* tangents;  // null when not wanted
  size_t tangent_stride_bytes;

  float* PositionOf(size_t vertex) const {
    return reinterpret_cast<float*>(reinterpret_cast<uint8_t*>(positions) + vertex * position_stride_bytes);
  }
};

// What an output draws: the garment, or its coarse mesh.
struct DrawnMesh {
  const uint16_t* vertices;  // [vertex_count], which of the garment's they are; null for all of them
  const uint16_t* faces;     // [triangle_count, 3], indices of drawn vertices
  uint32_t vertex_count;
  uint32_t triangle_count;
};
DrawnMesh MeshOf(const format::ModelView& model, const dcloth_output& output);

// What tangents are computed on: `mesh`, or the one that a texture is drawn on.
DrawnMesh TexturedMeshOf(const format::ModelView& model, const dcloth_output& output, const DrawnMesh& mesh);

// Copies positions and normals to the vertices that repeat a seam's, where the output wants those.
void RepeatSeams(const format::ModelView& model, const dcloth_output& output, const Surface& surface);

// Tells the first thing that is wrong with an output; `output` is not touched.
bool CheckOutput(const dcloth_output& output, const format::ModelView& model, format::Diagnostic* diagnostic);

// Bytes of scratch that the output's formats need; 0 where all are floats.
size_t ScratchBytes(const dcloth_output& output);

Surface SurfaceOf(const dcloth_output& output);

// Moves positions by `origin` (host units), turns normals outward in a mirrored space, stores what is no
// float in its format and takes the bounds.
void FinishOutput(const kernels::KernelTable& kernels, const float origin[3], bool mirrored, const Surface& surface,
                  const dcloth_output& output);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_DRAW_OUTPUT_H_
