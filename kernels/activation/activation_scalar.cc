#include "kernels/activation/activation_scalar.h"

#include "kernels/kernels.h"

namespace dcloth::kernels::scalar {

void Sigmoid(const SigmoidJob& job) {
  for (size_t i = 0; i < job.count; ++i) job.y[i] = SigmoidOf(job.x[i]);
}

void Tanh(const TanhJob& job) {
  for (size_t i = 0; i < job.count; ++i) job.y[i] = TanhOf(job.x[i]);
}

}  // namespace dcloth::kernels::scalar
