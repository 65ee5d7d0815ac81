#include "engine/src/draw/normals.h"

namespace dcloth::engine {

void RunNormals(const kernels::KernelTable& kernels, const DrawnMesh& mesh, const Surface& surface) {
  if (surface.normals == nullptr) return;
  kernels::NormalsJob job = {};
  job.positions = surface.positions;
  job.position_stride_bytes = surface.position_stride_bytes;
  job.triangles = mesh.faces;
  job.normals = surface.normals;
  job.normal_stride_bytes = surface.normal_stride_bytes;
  job.vertices = mesh.vertex_count;
  job.triangle_count = mesh.triangle_count;
  kernels.normals(job);
}

void RunTangents(const kernels::KernelTable& kernels, const DrawnMesh& mesh, bool mirrored, const float* texture,
                 const dcloth_output& output, const Surface& surface) {
  if (surface.tangents == nullptr) return;
  kernels::TangentsJob job = {};
  job.positions = surface.positions;
  job.position_stride_bytes = surface.position_stride_bytes;
  job.normals = surface.normals;
  job.normal_stride_bytes = surface.normal_stride_bytes;
  const bool given = output.texture_coordinates != nullptr;
  job.texture = given ? output.texture_coordinates : texture;
  job.texture_stride_bytes = given ? output.texture_stride_bytes : 2 * sizeof(float);
  job.tangents = surface.tangents;
  job.tangent_stride_bytes = surface.tangent_stride_bytes;
  job.triangles = mesh.faces;
  job.vertices = mesh.vertex_count;
  job.triangle_count = mesh.triangle_count;
  job.hand = mirrored ? -1.0f : 1.0f;
  kernels.tangents(job);
}

}  // namespace dcloth::engine
