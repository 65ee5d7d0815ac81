#include "kernels/kernels.h"

namespace dcloth::kernels::scalar {

void Skinning(const SkinningJob& job) {
  for (size_t slot = 0; slot < job.vertices; ++slot) {
    const size_t i = job.chosen == nullptr ? slot : job.chosen[slot];
    float p[3];
    for (size_t c = 0; c < 3; ++c) {
      p[c] = job.positions[3 * i + c];
      if (job.delta0 != nullptr) {
        const float from = job.delta0[3 * i + c];
        p[c] += from + job.blend * (job.delta1[3 * i + c] - from);
      }
    }
    float blended[12] = {};
    for (size_t k = 0; k < job.influences; ++k) {
      const float* matrix = job.matrices + size_t{12} * job.bones[i * job.influences + k];
      const float weight = job.weights[i * job.influences + k];
      for (size_t e = 0; e < 12; ++e) blended[e] += weight * matrix[e];
    }
    float* out = reinterpret_cast<float*>(reinterpret_cast<char*>(job.out) + slot * job.out_stride_bytes);
    for (size_t row = 0; row < 3; ++row) {
      const float* a = blended + 4 * row;
      out[row] = (a[0] * p[0] + a[2] * p[2]) + (a[1] * p[1] + a[3]);
    }
  }
}

}  // namespace dcloth::kernels::scalar
