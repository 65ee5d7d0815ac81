#include "kernels/activation/activation_scalar.h"
#include "kernels/kernels.h"

namespace dcloth::kernels::scalar {

void GruGates(const GruGatesJob& job) {
  const size_t k = job.k;
  for (size_t i = 0; i < k; ++i) {
    const float r = SigmoidOf(job.gx[i] + job.gh[i]);
    const float z = SigmoidOf(job.gx[k + i] + job.gh[k + i]);
    const float q = TanhOf(job.gx[2 * k + i] + r * job.gh[2 * k + i]);
    job.h[i] = q + z * (job.h[i] - q);
  }
}

}  // namespace dcloth::kernels::scalar
