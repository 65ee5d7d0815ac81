// The mean over a vertex's neighbours, row-major: lanes are features.
#include "kernels/gsgru/gsgru.h"

#if defined(DCLOTH_KERNELS_GSGRU_GSGRU_MEAN_INL_H_) == defined(HWY_TARGET_TOGGLE)
#ifdef DCLOTH_KERNELS_GSGRU_GSGRU_MEAN_INL_H_
#undef DCLOTH_KERNELS_GSGRU_GSGRU_MEAN_INL_H_
#else
#define DCLOTH_KERNELS_GSGRU_GSGRU_MEAN_INL_H_
#endif

#include "hwy/cache_control.h"
#include "hwy/highway.h"
#include "kernels/prefetch.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

// An inner vertex of a triangle mesh has six neighbours and itself: without a loop, F 8 takes a tenth less on a Zen 5.
constexpr uint32_t kUsualValence = 7;

template <size_t kVectors, class D>
HWY_INLINE void MeanColumns(D d, const GsgruJob& job, size_t stride, size_t vertex, size_t f, float* mean) {
  const uint32_t begin = job.row_starts[vertex], end = job.row_starts[vertex + 1];
  hn::Vec<D> sum[kVectors];
  for (size_t i = 0; i < kVectors; ++i) sum[i] = hn::Zero(d);
  const auto add = [&](uint32_t e) {
    const float* row = job.x + job.columns[e] * stride + f;
    for (size_t i = 0; i < kVectors; ++i) sum[i] = hn::Add(sum[i], hn::Load(d, row + i * hn::Lanes(d)));
  };
  if (end - begin == kUsualValence) {
    for (uint32_t e = 0; e < kUsualValence; ++e) add(begin + e);
  } else {
    for (uint32_t e = begin; e < end; ++e) add(e);
  }
  const auto inverse = hn::Set(d, 1.0f / static_cast<float>(end - begin));
  for (size_t i = 0; i < kVectors; ++i) hn::Store(hn::Mul(sum[i], inverse), d, mean + f + i * hn::Lanes(d));
}

// Rows of a block of kGsgruBlock vertices from `first` on, kStride floats each, or the job's where that is 0; those
// beyond `count` become zero.
template <size_t kStride, class D>
HWY_INLINE void AggregateRows(D d, const GsgruJob& job, size_t first, size_t count, float* HWY_RESTRICT mean) {
  const size_t lanes = hn::Lanes(d);
  const size_t stride = kStride == 0 ? GsgruInputStride(job.input_width) : kStride;
  for (size_t v = 0; v < count; ++v) {
    size_t f = 0;
    for (; f + 4 * lanes <= stride; f += 4 * lanes) MeanColumns<4>(d, job, stride, first + v, f, mean + v * stride);
    for (; f + 2 * lanes <= stride; f += 2 * lanes) MeanColumns<2>(d, job, stride, first + v, f, mean + v * stride);
    for (; f < stride; f += lanes) MeanColumns<1>(d, job, stride, first + v, f, mean + v * stride);
  }
  for (size_t i = count * stride; i < kGsgruBlock * stride; ++i) mean[i] = 0.0f;
}

// A stride known to the compiler spares a multiplication per neighbour: a tenth of a layer with F 8 in AVX-512.
template <class D>
HWY_INLINE void Aggregate(D d, const GsgruJob& job, size_t first, size_t count, float* HWY_RESTRICT mean) {
  if (job.input_width == 3) return AggregateRows<4>(hn::CappedTag<float, 4>(), job, first, count, mean);
  if (job.input_width == 8) return AggregateRows<8>(hn::CappedTag<float, 8>(), job, first, count, mean);
  AggregateRows<0>(d, job, first, count, mean);
}

// Apart, so that layers of all wide widths and both kinds of products share it.
template <class D>
HWY_NOINLINE void AggregateBlock(D d, const GsgruJob& job, size_t first, size_t count, float* mean) {
  Aggregate(d, job, first, count, mean);
}

// Asks for what a later block of vertices needs: its state, the rows that it writes, and each vertex's last neighbour,
// which in an ordered mesh is the one not yet seen. Only where a layer's rows do not stay in L2: at F 32 and 7,964
// vertices 3 MB pass, and a Zen 5 waits a tenth of its time for them; narrower layers lose 3 %. And for the block's
// share of what comes after the layer.
HWY_INLINE void PrefetchBlock(const GsgruJob& job, size_t first, size_t count) {
  if (job.block_ahead_bytes != 0) {
    const size_t block = (first - 1) / kGsgruBlock;
    PrefetchBytes(reinterpret_cast<uintptr_t>(job.ahead) + block * job.block_ahead_bytes, job.block_ahead_bytes);
  }
  const size_t width = job.features, stride = GsgruInputStride(job.input_width);
  if (width < 32) return;
  constexpr size_t kLine = 64 / sizeof(float);
  for (size_t i = first * width; i < (first + count) * width; i += kLine) {
    hwy::Prefetch(job.state + i);
    if (job.embed == nullptr) hwy::Prefetch(job.next_x + i);
  }
  for (size_t v = first; v < first + count; ++v) {
    const float* row = job.x + job.columns[job.row_starts[v + 1] - 1] * stride;
    for (size_t i = 0; i < stride; i += kLine) hwy::Prefetch(row + i);
  }
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_MEAN_INL_H_
