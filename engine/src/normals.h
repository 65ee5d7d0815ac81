// Vertex normals of the skinned garment.
#ifndef DCLOTH_ENGINE_SRC_NORMALS_H_
#define DCLOTH_ENGINE_SRC_NORMALS_H_

#include "engine/format/view.h"
#include "engine/src/output.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

// Run it while positions are relative to the hips: ten kilometres out, world floats are a millimetre apart and normals
// from them would be noise. Does nothing where surface.normals is null.
inline void RunNormals(const kernels::KernelTable& kernels, const format::ModelView& model,
                       const Surface& surface) {
  if (surface.normals == nullptr) return;
  kernels::NormalsJob job = {};
  job.positions = surface.positions;
  job.position_stride_bytes = surface.position_stride_bytes;
  job.triangles = model.faces;
  job.normals = surface.normals;
  job.normal_stride_bytes = surface.normal_stride_bytes;
  job.vertices = model.vertex_count;
  job.triangle_count = model.triangle_count;
  kernels.normals(job);
}

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NORMALS_H_
