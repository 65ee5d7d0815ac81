// Of all kernels this one alone has other bits with four lanes than in its scalar reference (reproducible_test): the sums
// of the layer norm and of the embedding run in four strands. The reference steps the state, then the norm is made anew
// from it. Rejected: Highway's emulation of 128-bit vectors for the whole table, a second copy of every kernel.
#include "kernels/gsgru/gsgru_strands.h"

#include "kernels/kernels.h"
#include "kernels/scalar_math.h"

namespace dcloth::kernels::strands {
namespace {

// Each strand takes every fourth term; then the first and third, the second and fourth, and their sum.
template <class Term>
float Sum(size_t count, Term term) {
  float strand[4] = {};
  for (size_t f = 0; f < count; ++f) strand[f % 4] += term(f);
  return (strand[0] + strand[2]) + (strand[1] + strand[3]);
}

}  // namespace

void Gsgru(const GsgruJob& job) {
  scalar::Gsgru(job);
  const size_t width = job.features;
  const float inverse_width = 1.0f / static_cast<float>(width);
  for (size_t i = 0; i < job.vertices; ++i) {
    const float* h = job.state + i * width;
    float o[kGsgruMaxFeatures];
    for (size_t f = 0; f < width; ++f) {
      o[f] = job.output_bias[f];
      for (size_t k = 0; k < width; ++k) o[f] += h[k] * job.output[k * width + f];
    }
    const float mean = Sum(width, [&](size_t f) { return o[f]; }) * inverse_width;
    const float variance = Sum(width, [&](size_t f) { return (o[f] - mean) * (o[f] - mean); }) * inverse_width;
    const float inverse = 1.0f / scalar::SquareRoot(variance + kGsgruEpsilon);
    for (size_t f = 0; f < width; ++f) {
      const float y = (o[f] - mean) * inverse * job.norm_gain[f] + job.norm_offset[f];
      o[f] = job.prelu_slope * (y < 0.0f ? y : 0.0f) + (y > 0.0f ? y : 0.0f);
    }
    if (job.embed != nullptr) {
      job.s[i] = Sum(width, [&](size_t f) { return o[f] * job.embed[f]; }) + job.embed_bias;
    } else {
      for (size_t f = 0; f < width; ++f) job.next_x[i * width + f] = o[f];
    }
  }
}

}  // namespace dcloth::kernels::strands
