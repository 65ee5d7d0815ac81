// Tangents as every instruction set computes them, but for the square root, which is handed in. Not across triangles or
// vertices: both are pieces of 12 and 16 bytes, triangles' at random places.
#ifndef DCLOTH_KERNELS_OUTPUT_TANGENTS_H_
#define DCLOTH_KERNELS_OUTPUT_TANGENTS_H_

#include <cstddef>
#include <cstdint>

#include "kernels/output/output.h"

namespace dcloth::kernels {

template <typename T>
inline T* StridedAt(T* values, size_t stride_bytes, size_t vertex) {
  return reinterpret_cast<T*>(reinterpret_cast<uintptr_t>(values) + stride_bytes * vertex);
}

// Adds |det| dP/du and det to the corners of every triangle.
inline void AccumulateTangents(const TangentsJob& job) {
  for (size_t i = 0; i < job.vertices; ++i) {
    float* tangent = StridedAt(job.tangents, job.tangent_stride_bytes, i);
    for (size_t c = 0; c < 4; ++c) tangent[c] = 0.0f;
  }
  for (size_t t = 0; t < job.triangle_count; ++t) {
    const uint16_t* corner = job.triangles + 3 * t;
    const float *p[3], *uv[3];
    for (size_t k = 0; k < 3; ++k) {
      p[k] = StridedAt(job.positions, job.position_stride_bytes, corner[k]);
      uv[k] = StridedAt(job.texture, job.texture_stride_bytes, corner[k]);
    }
    const float u1 = uv[1][0] - uv[0][0], v1 = uv[1][1] - uv[0][1];
    const float u2 = uv[2][0] - uv[0][0], v2 = uv[2][1] - uv[0][1];
    const float det = u1 * v2 - u2 * v1, sign = det < 0.0f ? -1.0f : 1.0f;
    for (size_t k = 0; k < 3; ++k) {
      float* tangent = StridedAt(job.tangents, job.tangent_stride_bytes, corner[k]);
      for (size_t c = 0; c < 3; ++c) {
        tangent[c] += sign * ((p[1][c] - p[0][c]) * v2 - (p[2][c] - p[0][c]) * v1);
      }
      tangent[3] += det;
    }
  }
}

// The part of `v` perpendicular to the unit vector n, made unit; false where there is none to speak of.
template <typename Root>
inline bool MakePerpendicular(const float* n, float* v, Root root) {
  const float along = n[0] * v[0] + n[1] * v[1] + n[2] * v[2];
  const float whole = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  for (size_t c = 0; c < 3; ++c) v[c] -= along * n[c];
  const float square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  if (!(square > 1e-6f * whole && square > 1e-30f)) return false;
  const float inverse = 1.0f / root(square);
  for (size_t c = 0; c < 3; ++c) v[c] *= inverse;
  return true;
}

template <typename Root>
inline void ComputeTangents(const TangentsJob& job, Root root) {
  AccumulateTangents(job);
  for (size_t i = 0; i < job.vertices; ++i) {
    const float* normal = StridedAt(job.normals, job.normal_stride_bytes, i);
    float* tangent = StridedAt(job.tangents, job.tangent_stride_bytes, i);
    if (!MakePerpendicular(normal, tangent, root)) {
      // Away from the normal's largest part.
      const bool along_x = normal[0] * normal[0] > 0.5f;
      tangent[0] = along_x ? 0.0f : 1.0f;
      tangent[1] = along_x ? 1.0f : 0.0f;
      tangent[2] = 0.0f;
      (void)MakePerpendicular(normal, tangent, root);
    }
    tangent[3] = tangent[3] < 0.0f ? -job.hand : job.hand;
  }
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_OUTPUT_TANGENTS_H_
