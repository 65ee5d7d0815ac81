// The scatter half of the normals, for the scalar reference and for vectors without masked loads.
//
// Not across triangles: their three positions and three sums are 12-byte pieces at random places. A triangle's own
// vectors pay where masked loads of 12 bytes are there (normals_vector.cc). Rejected: sums of 16 bytes in memory of
// their own, as an instance would grow by 127 KB for what those vectors gain too; offsets in place of pointers (60 us
// against 59).
#ifndef DCLOTH_KERNELS_NORMALS_NORMALS_ACCUMULATE_H_
#define DCLOTH_KERNELS_NORMALS_NORMALS_ACCUMULATE_H_

#include <cstddef>
#include <cstdint>

#include "kernels/normals/normals.h"

namespace dcloth::kernels {

inline float* NormalAt(const NormalsJob& job, size_t vertex) {
  return reinterpret_cast<float*>(reinterpret_cast<char*>(job.normals) + vertex * job.normal_stride_bytes);
}

// Strides known to the compiler, 0 where the job's count, spare six multiplications a triangle: 59 us against 68.
template <size_t kPositionStride, size_t kNormalStride>
inline void AccumulateAt(const NormalsJob& job) {
  const size_t position_stride = kPositionStride != 0 ? kPositionStride : job.position_stride_bytes;
  const size_t normal_stride = kNormalStride != 0 ? kNormalStride : job.normal_stride_bytes;
  const auto position = [&](size_t vertex) {
    return reinterpret_cast<const float*>(reinterpret_cast<const char*>(job.positions) + vertex * position_stride);
  };
  const auto normal = [&](size_t vertex) {
    return reinterpret_cast<float*>(reinterpret_cast<char*>(job.normals) + vertex * normal_stride);
  };
  for (size_t i = 0; i < job.vertices; ++i) {
    float* n = normal(i);
    n[0] = n[1] = n[2] = 0.0f;
  }
  for (size_t t = 0; t < job.triangle_count; ++t) {
    const uint16_t* corner = job.triangles + 3 * t;
    const float *a = position(corner[0]), *b = position(corner[1]), *c = position(corner[2]);
    const float ux = b[0] - a[0], uy = b[1] - a[1], uz = b[2] - a[2];
    const float vx = c[0] - a[0], vy = c[1] - a[1], vz = c[2] - a[2];
    const float x = uy * vz - uz * vy;
    const float y = uz * vx - ux * vz;
    const float z = ux * vy - uy * vx;
    for (size_t k = 0; k < 3; ++k) {
      float* n = normal(corner[k]);
      n[0] += x;
      n[1] += y;
      n[2] += z;
    }
  }
}

// Sums of the cross products of each vertex's triangles, in the triangles' order.
inline void AccumulateNormals(const NormalsJob& job) {
  constexpr size_t kTight = 3 * sizeof(float);
  if (job.position_stride_bytes == kTight && job.normal_stride_bytes == kTight)
    return AccumulateAt<kTight, kTight>(job);
  AccumulateAt<0, 0>(job);
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_NORMALS_NORMALS_ACCUMULATE_H_
