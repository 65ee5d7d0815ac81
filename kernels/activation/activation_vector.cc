#include "kernels/simd.h"

#include "kernels/activation/activation.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "kernels/activation/activation_vector.cc"
#include "hwy/foreach_target.h"
#include "hwy/highway.h"
#include "kernels/activation/activation-inl.h"

#if DCLOTH_VECTOR_TARGET
HWY_BEFORE_NAMESPACE();
namespace dcloth::kernels::HWY_NAMESPACE {
namespace {

constexpr size_t kLanes = HWY_LANES(float);

struct SigmoidMap {
  template <class D>
  static HWY_INLINE hn::Vec<D> Apply(D d, hn::Vec<D> x) {
    return SigmoidOf(d, x);
  }
};

struct TanhMap {
  template <class D>
  static HWY_INLINE hn::Vec<D> Apply(D d, hn::Vec<D> x) {
    return TanhOf(d, x);
  }
};

template <class Map>
HWY_INLINE void MapArray(const float* x, float* y, size_t count) {
  const hn::ScalableTag<float> d;
  const hn::CappedTag<float, 1> d1;
  size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) hn::StoreU(Map::Apply(d, hn::LoadU(d, x + i)), d, y + i);
  for (; i < count; ++i) hn::StoreU(Map::Apply(d1, hn::LoadU(d1, x + i)), d1, y + i);
}

}  // namespace

void Sigmoid(const SigmoidJob& job) { MapArray<SigmoidMap>(job.x, job.y, job.count); }
void Tanh(const TanhJob& job) { MapArray<TanhMap>(job.x, job.y, job.count); }

}  // namespace dcloth::kernels::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
#endif  // DCLOTH_VECTOR_TARGET
