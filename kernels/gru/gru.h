// The elementwise half of a GRU in PyTorch's convention (NETWORK.md, "Skeleton stage"); the products come from matvec.
// Bit-identical on every instruction set: with int8 weights, then, so is the whole stage.
//   r = s(gx_r + gh_r); z = s(gx_z + gh_z); q = tanh(gx_q + r gh_q); h' = (1 - z) q + z h
#ifndef DCLOTH_KERNELS_GRU_GRU_H_
#define DCLOTH_KERNELS_GRU_GRU_H_

#include <cstddef>

namespace dcloth::kernels {

struct GruGatesJob {
  const float* gx;  // [3 k]: W x + b, gates r, z, q one after another
  const float* gh;  // [3 k]: U h + c, the same order
  float* h;         // [k], replaced by h'
  size_t k;
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_GRU_GRU_H_
