// Linear blend skinning: out_i = sum_k w_ik A_{b_ik} (T_i + delta_i) (NETWORK.md, "Static stage"), delta_i interpolated
// between two ticks. Also poses the nearest body points (no delta).
#ifndef DCLOTH_KERNELS_SKINNING_SKINNING_H_
#define DCLOTH_KERNELS_SKINNING_SKINNING_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

constexpr size_t kMaxInfluences = 8;

// Writes exactly 12 bytes a vertex. Nothing is read past an array's end. Every array starts on its element's width.
struct SkinningJob {
  const float* matrices;    // [bones, 12]: three rows of four
  const float* positions;   // [vertices, 3]
  const float* delta0;      // [vertices, 3]; null (both) for none
  const float* delta1;      // [vertices, 3]
  const uint8_t* bones;     // [vertices, influences], indices into matrices
  const float* weights;     // [vertices, influences]
  float* out;               // first vertex; the next one lies out_stride_bytes further
  size_t out_stride_bytes;  // at least 12, a multiple of 4
  size_t vertices;
  size_t influences;                 // 1 to kMaxInfluences
  float blend;                       // delta = delta0 + blend (delta1 - delta0)
  const void* ahead = nullptr;       // [vertices, 12 bytes] used after the job, asked for into L2; or null
  const uint16_t* chosen = nullptr;  // [vertices], rising: which of the arrays' vertices are skinned; null for all.
                                     // `out` has no gaps
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_SKINNING_SKINNING_H_
