#include "engine/src/draw/normals.h"

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>

namespace dcloth::engine {
namespace {

template <typename T>
T* At(T* values, size_t stride_bytes, size_t vertex) {
  using Byte = std::conditional_t<std::is_const_v<T>, const uint8_t, uint8_t>;
  return reinterpret_cast<T*>(reinterpret_cast<Byte*>(values) + stride_bytes * vertex);
}

// Adds |det| dP/du and det to the corners of every triangle.
void Accumulate(const format::ModelView& model, const dcloth_output& output, const Surface& surface) {
  for (size_t t = 0; t < model.triangle_count; ++t) {
    const uint16_t* corner = model.faces + 3 * t;
    const float *p[3], *uv[3];
    for (int k = 0; k < 3; ++k) {
      p[k] = At<const float>(surface.positions, surface.position_stride_bytes, corner[k]);
      uv[k] = At(output.texture_coordinates, output.texture_stride_bytes, corner[k]);
    }
    const float u1 = uv[1][0] - uv[0][0], v1 = uv[1][1] - uv[0][1];
    const float u2 = uv[2][0] - uv[0][0], v2 = uv[2][1] - uv[0][1];
    const float det = u1 * v2 - u2 * v1, sign = det < 0.0f ? -1.0f : 1.0f;
    for (int k = 0; k < 3; ++k) {
      float* tangent = At(surface.tangents, surface.tangent_stride_bytes, corner[k]);
      for (int c = 0; c < 3; ++c) {
        tangent[c] += sign * ((p[1][c] - p[0][c]) * v2 - (p[2][c] - p[0][c]) * v1);
      }
      tangent[3] += det;
    }
  }
}

// The part of `v` perpendicular to the unit vector n, made unit; false where there is none to speak of.
bool MakePerpendicular(const float* n, float* v) {
  const float along = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
  const float whole = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  for (int c = 0; c < 3; ++c) v[c] -= along * n[c];
  const float square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  if (!(square > 1e-6f * whole && square > 1e-30f)) return false;
  const float inverse = 1.0f / std::sqrt(square);
  for (int c = 0; c < 3; ++c) v[c] *= inverse;
  return true;
}

void Finish(const float* normal, float hand, float* tangent) {
  if (!MakePerpendicular(normal, tangent)) {
    // Texture coordinates that say nothing: any direction in the surface, away from the normal's largest
    // part.
    const bool along_x = normal[0] * normal[0] > 0.5f;
    tangent[0] = along_x ? 0.0f : 1.0f;
    tangent[1] = along_x ? 1.0f : 0.0f;
    tangent[2] = 0.0f;
    (void)MakePerpendicular(normal, tangent);
  }
  tangent[3] = tangent[3] < 0.0f ? -hand : hand;
}

}  // namespace

void RunNormals(const kernels::KernelTable& kernels, const format::ModelView& model, const Surface& surface) {
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

void RunTangents(const format::ModelView& model, bool mirrored, const dcloth_output& output, const Surface& surface) {
  if (surface.tangents == nullptr) return;
  for (uint32_t i = 0; i < model.vertex_count; ++i) {
    float* tangent = At(surface.tangents, surface.tangent_stride_bytes, i);
    for (int c = 0; c < 4; ++c) tangent[c] = 0.0f;
  }
  Accumulate(model, output, surface);
  for (uint32_t i = 0; i < model.vertex_count; ++i) {
    Finish(At<const float>(surface.normals, surface.normal_stride_bytes, i), mirrored ? -1.0f : 1.0f,
           At(surface.tangents, surface.tangent_stride_bytes, i));
  }
}

}  // namespace dcloth::engine
