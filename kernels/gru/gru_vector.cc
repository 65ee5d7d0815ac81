#include "kernels/simd.h"

#include "kernels/gru/gru.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/gru/gru_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
#include "kernels/activation/activation-inl.h"
#include "kernels/multiply_add-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

// Nothing is fused: the next tick rounds h to integers (int8 weights), where a last bit may move a whole step.
constexpr bool kFuse = false;

template <class D>
HWY_INLINE void GatesAt(D d, const GruGatesJob& job, size_t i) {
  const size_t k = job.k;
  const auto r = SigmoidOf<kFuse>(d, hn::Add(hn::LoadU(d, job.gx + i), hn::LoadU(d, job.gh + i)));
  const auto z = SigmoidOf<kFuse>(d, hn::Add(hn::LoadU(d, job.gx + k + i), hn::LoadU(d, job.gh + k + i)));
  const auto q_in = MultiplyAdd<kFuse>(r, hn::LoadU(d, job.gh + 2 * k + i), hn::LoadU(d, job.gx + 2 * k + i));
  const auto q = TanhOf<kFuse>(d, q_in);
  hn::StoreU(MultiplyAdd<kFuse>(z, hn::Sub(hn::LoadU(d, job.h + i), q), q), d, job.h + i);
}

}  // namespace

void GruGates(const GruGatesJob& job) {
  const hn::ScalableTag<float> d;
  const hn::CappedTag<float, 1> d1;
  constexpr size_t kLanes = HWY_LANES(float);
  size_t i = 0;
  for (; i + kLanes <= job.k; i += kLanes) GatesAt(d, job, i);
  for (; i < job.k; ++i) GatesAt(d1, job, i);
}

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
