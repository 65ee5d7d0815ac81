// The scatter half of the normals, the same for the scalar reference and for vectors.
//
// Not vectorised: a triangle's three positions and three sums are 12-byte pieces at random places; loading and storing them
// as vectors takes as many instructions (36 against 42 a triangle) as plain floats.
#ifndef DCLOTH_KERNELS_NORMALS_NORMALS_ACCUMULATE_H_
#define DCLOTH_KERNELS_NORMALS_NORMALS_ACCUMULATE_H_

#include <cstddef>
#include <cstdint>

#include "kernels/normals/normals.h"

namespace dcloth::kernels {

inline const float* PositionAt(const NormalsJob& job, size_t vertex) {
  return reinterpret_cast<const float*>(reinterpret_cast<const char*>(job.positions) +
                                        vertex * job.position_stride_bytes);
}

inline float* NormalAt(const NormalsJob& job, size_t vertex) {
  return reinterpret_cast<float*>(reinterpret_cast<char*>(job.normals) + vertex * job.normal_stride_bytes);
}

inline void AccumulateNormals(const NormalsJob& job) {
  for (size_t i = 0; i < job.vertices; ++i) {
    float* n = NormalAt(job, i);
    n[0] = n[1] = n[2] = 0.0f;
  }
  for (size_t t = 0; t < job.triangle_count; ++t) {
    const uint16_t* corner = job.triangles + 3 * t;
    const float* a = PositionAt(job, corner[0]);
    const float* b = PositionAt(job, corner[1]);
    const float* c = PositionAt(job, corner[2]);
    const float ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
    const float vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
    const float x = uy * vz - uz * vy;
    const float y = uz * vx - ux * vz;
    const float z = ux * vy - uy * vx;
    for (size_t k = 0; k < 3; ++k) {
      float* n = NormalAt(job, corner[k]);
      n[0] += x;
      n[1] += y;
      n[2] += z;
    }
  }
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_NORMALS_NORMALS_ACCUMULATE_H_
