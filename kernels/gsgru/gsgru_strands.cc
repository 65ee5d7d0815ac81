// Of all kernels these two alone have other bits with four lanes than in their scalar references (reproducible_test):
// the sums of the layer norm and of the embedding run in four strands. The reference steps the state, then the norm is
// made anew from it. Rejected: Highway's emulation of 128-bit vectors for the whole table, a second copy of every
// kernel.
#include "kernels/gsgru/gsgru_strands.h"

#include "kernels/gsgru/gsgru_plain.h"
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

void Finish(const GsgruJob& job, size_t vertex, float* o) {
  const size_t width = job.features;
  const float inverse_width = 1.0f / static_cast<float>(width);
  const float mean = Sum(width, [&](size_t f) { return o[f]; }) * inverse_width;
  const float variance = Sum(width, [&](size_t f) { return (o[f] - mean) * (o[f] - mean); }) * inverse_width;
  const float inverse = 1.0f / scalar::SquareRoot(variance + kGsgruEpsilon);
  for (size_t f = 0; f < width; ++f) {
    const float y = (o[f] - mean) * inverse * job.norm_gain[f] + job.norm_offset[f];
    o[f] = job.prelu_slope * (y < 0.0f ? y : 0.0f) + (y > 0.0f ? y : 0.0f);
  }
  if (job.embed != nullptr) {
    job.s[vertex] = Sum(width, [&](size_t f) { return o[f] * job.embed[f]; }) + job.embed_bias;
  } else {
    for (size_t f = 0; f < width; ++f) job.next_x[vertex * width + f] = o[f];
  }
}

}  // namespace

void Gsgru(const GsgruJob& job) {
  scalar::Gsgru(job);
  const size_t width = job.features;
  for (size_t i = 0; i < job.vertices; ++i) {
    float o[kGsgruMaxFeatures];
    for (size_t f = 0; f < width; ++f) o[f] = job.output_bias[f];
    scalar::GsgruAddProduct(job.state + i * width, width, job.output, width, o);
    Finish(job, i, o);
  }
}

void GsgruI8(const GsgruI8Job& job) {
  scalar::GsgruI8(job);
  for (size_t i = 0; i < job.layer.vertices; ++i) {
    float o[kGsgruMaxFeatures];
    scalar::GsgruI8Output(job, job.layer.state + i * job.layer.features, o);
    Finish(job.layer, i, o);
  }
}

}  // namespace dcloth::kernels::strands
