// Vertex normals: the normalised sum of the cross products of a vertex's triangles, i.e. weighted by area.
// Counter-clockwise triangles give outward normals. A vertex without area (no triangle, or a sum whose squared length
// is below kNormalsTiny) gets (0, 1, 0), as does one whose sum leaves the floats: every normal is a unit vector.
#ifndef DCLOTH_KERNELS_NORMALS_NORMALS_H_
#define DCLOTH_KERNELS_NORMALS_NORMALS_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

constexpr float kNormalsTiny = 1e-30f;            // m^4: triangles of about 0.03 micrometres a side
constexpr float kNormalsHuge = 3.402823466e+38f;  // m^4, the largest float: triangles of a thousand kilometres a side

// Reads and writes exactly 12 bytes a vertex; sums grow in `normals`, so no other memory is needed. The two arrays may
// interleave (one vertex buffer) but their 12-byte ranges do not overlap.
struct NormalsJob {
  const float* positions;
  size_t position_stride_bytes;  // at least 12, a multiple of 4
  const uint16_t* triangles;     // [triangle_count, 3], each below `vertices`
  float* normals;
  size_t normal_stride_bytes;  // at least 12, a multiple of 4
  size_t vertices;
  size_t triangle_count;
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_NORMALS_NORMALS_H_
