// The last passes over the drawn garment: tangents, the move into the world with the bounds, half floats. One pass over
// the vertices each, tangents one over the triangles before.
#ifndef DCLOTH_KERNELS_OUTPUT_OUTPUT_H_
#define DCLOTH_KERNELS_OUTPUT_OUTPUT_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

// Adds `origin` to every position. `bounds`: least x, y, z, then greatest, of the moved positions, [6], or null. A
// position that is NaN leaves the bounds as they are; of none they are kEmptyBound and its negative. Sums are the same
// bits on every instruction set; a bound of zero may have either sign.
constexpr float kEmptyBound = 3.4e38f;
struct MoveJob {
  float* positions;
  size_t stride_bytes;  // at least 12, a multiple of 4; 12 bytes a vertex are read and written
  const float* origin;  // [3]
  float* bounds;
  size_t vertices;
};

// Stores rows of floats as halves, HalfFromFloat of each.
struct StoreHalfJob {
  const float* from;  // [vertices, elements], tight
  uint16_t* to;
  size_t stride_bytes;  // of `to`: at least 2 elements, a multiple of 2
  size_t elements;      // 3 or 4
  size_t vertices;
};

// Vertex tangents. xyz: the direction in which u grows, the triangles' (dP/du |det|) summed, made perpendicular to the
// normal and unit; any direction in the surface where texture coordinates give none. w: 1 or -1, `hand` where the sum
// of det is not negative. The same bits on every instruction set.
struct TangentsJob {
  const float* positions;
  size_t position_stride_bytes;
  const float* normals;  // unit
  size_t normal_stride_bytes;
  const float* texture;  // u, v
  size_t texture_stride_bytes;
  float* tangents;  // 16 bytes a vertex are read and written
  size_t tangent_stride_bytes;
  const uint16_t* triangles;  // [triangle_count, 3], each below `vertices`
  size_t vertices;
  size_t triangle_count;
  float hand;  // 1 or -1
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_OUTPUT_OUTPUT_H_
