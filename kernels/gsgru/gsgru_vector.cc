// The graph-recurrent layer, block by block of 16 vertices, everything row-major with lanes over features.
//
// Lanes over features read weights as they lie in the model and need no transposition; a product tile of 4 vertices by
// 3 vectors takes 7 loads for 12 multiply-adds. Each stage runs over the whole block, columns outside and vertices
// inside, so that a column of weights comes to L1 once for 16 vertices. The only horizontal sums are in
// gsgru_norm-inl.h. A width that does not fill 16 lanes goes to gsgru_over_vertices-inl.h. Rejected: tiles of 6 by 2
// over blocks of 24 (Zen 3: no gain at any width); with 16 lanes, on a Zen 5, tiles of 8 vertices (F 32: 856 us a layer
// against 825).
#include "kernels/simd.h"

#include "kernels/gsgru/gsgru.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/gsgru/gsgru_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
#include "kernels/activation/activation-inl.h"
#include "kernels/gsgru/gsgru_mean-inl.h"
#include "kernels/gsgru/gsgru_norm-inl.h"
#include "kernels/gsgru/gsgru_over_vertices-inl.h"
#include "kernels/multiply_add-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

// Parts of the scratch, [kGsgruBlock, width] each.
struct Tiles {
  float* mean;       // aggregated input
  float* update;     // z
  float* reset;      // r h
  float* candidate;  // the candidate's input part, later o
};

// acc[v][i] += sum over k of x[v * x_stride + k] * weights[k * w_stride + i * vector_stride + lane], for i < kUsed.
template <size_t kUsed, class D, size_t kVertices, size_t kVectors>
HWY_INLINE void AddProduct(D d, const float* HWY_RESTRICT x, size_t x_stride, size_t rows,
                           const float* HWY_RESTRICT weights, size_t w_stride, size_t vector_stride,
                           hn::Vec<D> (&acc)[kVertices][kVectors]) {
  for (size_t k = 0; k < rows; ++k) {
    hn::Vec<D> w[kUsed];
    for (size_t i = 0; i < kUsed; ++i) w[i] = hn::Load(d, weights + k * w_stride + i * vector_stride);
    for (size_t v = 0; v < kVertices; ++v) {
      const auto value = hn::Set(d, x[v * x_stride + k]);
      for (size_t i = 0; i < kUsed; ++i) acc[v][i] = MultiplyAdd(value, w[i], acc[v][i]);
    }
  }
}

// z and r h complete, the candidate's input part.
template <class D>
HWY_INLINE void Gates(D d, const GsgruJob& job, const float* HWY_RESTRICT h, const Tiles& tiles) {
  constexpr size_t kVertices = 4;
  const size_t width = job.features;
  for (size_t f = 0; f < width; f += hn::Lanes(d)) {
    for (size_t v = 0; v < kGsgruBlock; v += kVertices) {
      hn::Vec<D> acc[kVertices][3];
      for (size_t i = 0; i < 3; ++i) {
        const auto bias = hn::Load(d, job.gate_bias + i * width + f);
        for (size_t u = 0; u < kVertices; ++u) acc[u][i] = bias;
      }
      const size_t mean_stride = GsgruInputStride(job.input_width);
      AddProduct<3>(d, tiles.mean + v * mean_stride, mean_stride, job.input_width, job.input_gates + f, 3 * width,
                    width, acc);
      AddProduct<2>(d, h + v * width, width, width, job.hidden_gates + f, 2 * width, width, acc);
      for (size_t u = 0; u < kVertices; ++u) {
        const size_t at = (v + u) * width + f;
        hn::Store(SigmoidOf(d, acc[u][0]), d, tiles.update + at);
        hn::Store(hn::Mul(SigmoidOf(d, acc[u][1]), hn::Load(d, h + at)), d, tiles.reset + at);
        hn::Store(acc[u][2], d, tiles.candidate + at);
      }
    }
  }
}

// h' in place, for a tile of vertices by vectors.
template <size_t kVertices, size_t kVectors, class D>
HWY_INLINE void UpdateTile(D d, const GsgruJob& job, float* HWY_RESTRICT h, const Tiles& tiles, size_t v, size_t f) {
  const size_t width = job.features;
  hn::Vec<D> acc[kVertices][kVectors];
  for (size_t u = 0; u < kVertices; ++u) {
    for (size_t i = 0; i < kVectors; ++i) {
      acc[u][i] = hn::Load(d, tiles.candidate + (v + u) * width + f + i * hn::Lanes(d));
    }
  }
  AddProduct<kVectors>(d, tiles.reset + v * width, width, width, job.hidden_candidate + f, width, hn::Lanes(d), acc);
  for (size_t u = 0; u < kVertices; ++u) {
    for (size_t i = 0; i < kVectors; ++i) {
      const size_t at = (v + u) * width + f + i * hn::Lanes(d);
      const auto old = hn::Load(d, h + at);
      const auto step = hn::Sub(TanhOf(d, acc[u][i]), old);
      hn::Store(MultiplyAdd(hn::Load(d, tiles.update + at), step, old), d, h + at);
    }
  }
}

// o into tiles.candidate.
template <size_t kVertices, size_t kVectors, class D>
HWY_INLINE void OutputTile(D d, const GsgruJob& job, const float* HWY_RESTRICT h, const Tiles& tiles, size_t v,
                           size_t f) {
  const size_t width = job.features;
  hn::Vec<D> acc[kVertices][kVectors];
  for (size_t i = 0; i < kVectors; ++i) {
    const auto bias = hn::Load(d, job.output_bias + f + i * hn::Lanes(d));
    for (size_t u = 0; u < kVertices; ++u) acc[u][i] = bias;
  }
  AddProduct<kVectors>(d, h + v * width, width, width, job.output + f, width, hn::Lanes(d), acc);
  for (size_t u = 0; u < kVertices; ++u) {
    for (size_t i = 0; i < kVectors; ++i) {
      hn::Store(acc[u][i], d, tiles.candidate + (v + u) * width + f + i * hn::Lanes(d));
    }
  }
}

// Eight accumulators either way: 4 vertices by 2 vectors, and 8 by 1 for an odd last vector.
template <class D>
HWY_INLINE void UpdateAndOutput(D d, const GsgruJob& job, float* HWY_RESTRICT h, const Tiles& tiles) {
  const size_t lanes = hn::Lanes(d);
  const size_t paired = job.features / (2 * lanes) * (2 * lanes);
  for (size_t f = 0; f < paired; f += 2 * lanes) {
    for (size_t v = 0; v < kGsgruBlock; v += 4) UpdateTile<4, 2>(d, job, h, tiles, v, f);
  }
  if (paired < job.features) {
    for (size_t v = 0; v < kGsgruBlock; v += 8) UpdateTile<8, 1>(d, job, h, tiles, v, paired);
  }
  for (size_t f = 0; f < paired; f += 2 * lanes) {
    for (size_t v = 0; v < kGsgruBlock; v += 4) OutputTile<4, 2>(d, job, h, tiles, v, f);
  }
  if (paired < job.features) {
    for (size_t v = 0; v < kGsgruBlock; v += 8) OutputTile<8, 1>(d, job, h, tiles, v, paired);
  }
}

// A width known to the compiler unrolls the products; 0 takes the job's. The copy lets the constant reach every stage.
template <size_t kFeatures, class D>
HWY_NOINLINE void RunLayer(D d, const GsgruJob& caller_job) {
  constexpr bool kShared = kFeatures != 8;  // narrow layers spend a third of their time there
  GsgruJob job = caller_job;
  if (kFeatures != 0) job.features = kFeatures;
  const size_t tile = kGsgruBlock * job.features;
  const Tiles tiles = {job.scratch, job.scratch + tile, job.scratch + 2 * tile, job.scratch + 3 * tile};
  for (size_t first = 0; first < job.vertices; first += kGsgruBlock) {
    const size_t count = HWY_MIN(kGsgruBlock, job.vertices - first), next = first + count;
    PrefetchBlock(job, next, HWY_MIN(kGsgruBlock, job.vertices - next));
    float* h = job.state + first * job.features;
    kShared ? AggregateBlock(d, job, first, count, tiles.mean) : Aggregate(d, job, first, count, tiles.mean);
    Gates(d, job, h, tiles);
    UpdateAndOutput(d, job, h, tiles);
    if (kShared) {
      NormBlock(d, job, tiles.candidate, first, count);
      continue;
    }
    for (size_t v = 0; v < count; v += 4) {
      NormFour(d, job, tiles.candidate + v * job.features, first + v, HWY_MIN(size_t{4}, count - v));
    }
  }
}

}  // namespace

void Gsgru(const GsgruJob& job) {
  const hn::ScalableTag<float> d;
  switch (HWY_TARGET == HWY_SSE4 ? 0 : job.features) {  // old CPUs are not worth 20 KB
    case 16:
      return RunLayer<16>(d, job);
    case 32:
      return RunLayer<32>(d, job);
#if HWY_TARGET != HWY_AVX3
    case 8:
      return RunLayer<8>(d, job);
#endif
    default:
      break;
  }
#if HWY_TARGET == HWY_AVX3
  if (job.features == 8 && job.input_width == 8) return over_vertices::RunLayer<8>(job);
  if (job.features % HWY_LANES(float) != 0) return over_vertices::RunLayer<0>(job);
#endif
  RunLayer<0>(d, job);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
