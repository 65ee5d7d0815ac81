// Sigmoid and tanh over an array; the inline vector forms that the recurrent kernels use are in activation-inl.h.
// y may equal x; otherwise the two do not overlap.
#ifndef DCLOTH_KERNELS_ACTIVATION_ACTIVATION_H_
#define DCLOTH_KERNELS_ACTIVATION_ACTIVATION_H_

#include <cstddef>

namespace dcloth::kernels {

struct SigmoidJob {
  const float* x;  // [count]
  float* y;        // [count]
  size_t count;
};

struct TanhJob {
  const float* x;  // [count]
  float* y;        // [count]
  size_t count;
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_ACTIVATION_ACTIVATION_H_
