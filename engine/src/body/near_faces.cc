#include "engine/src/body/near_faces.h"

#include <cmath>

namespace dcloth::engine {
namespace {

using kernels::kNearestGroup;
using kernels::kNearestSiteFloats;

constexpr size_t kBlock = 16;             // groups that are looked at together; their rows are padded to it
constexpr float kEdge = 3 * (1 + 1e-4f);  // a vertex's longest edge, squared, is three times its slack^2
constexpr float kLeast = 1e-30f;
constexpr float kFar = 3e38f;
constexpr Box kNothing = {{kFar, kFar, kFar}, {-kFar, -kFar, -kFar}};

// The larger one. Without a comparison, so that compilers compute several side by side.
float OrZero(float value) { return 0.5f * (value + std::fabs(value)); }

// Of kCount boxes, whose bounds lie `stride` apart, how much nearer to `box` they are than the longest edge there,
// squared: above 0 where a face there may meet it. Returns whether one is.
template <size_t kCount>
bool Meet(const float* low, const float* high, const float* slack, size_t stride, const Box& box, float* nearer) {
  for (size_t i = 0; i < kCount; ++i) nearer[i] = kEdge * slack[i] + kLeast;
  for (size_t c = 0; c < 3; ++c) {
    for (size_t i = 0; i < kCount; ++i) {
      const float gap = OrZero(box.low[c] - high[c * stride + i]) + OrZero(low[c * stride + i] - box.high[c]);
      nearer[i] -= gap * gap;
    }
  }
  float any = 0;
  if constexpr (kCount == 1) {
    any = OrZero(nearer[0]);
  } else {
    float sums[4] = {};
    for (size_t i = 0; i < kCount; i += 4) {
      for (size_t k = 0; k < 4; ++k) sums[k] += OrZero(nearer[i + k]);
    }
    any = (sums[0] + sums[1]) + (sums[2] + sums[3]);
  }
  return any > 0;
}

}  // namespace

uint32_t NearFaces::FindGroups(const Surface& surface, TriangleBatch* batch) const {
  Box all = kNothing;
  for (size_t i = 0; i < batch->count; ++i) {
    Box* box = batch->boxes + i;
    *box = kNothing;
    for (size_t k = 0; k < 3; ++k) {
      const float* p = surface.PositionOf(batch->faces[i][k]);
      box->Hold(p, p);
    }
    all.Hold(box->low, box->high);
  }
  batch->group_count = 0;
  const float *low = sites_.bounds + kernels::kLow * stride_, *high = sites_.bounds + kernels::kHigh * stride_;
  const float* slack = sites_.bounds + kernels::kSlack * stride_;
  for (size_t block = 0; block < sites_.groups; block += kBlock) {
    float nearer[kBlock];
    if (!Meet<kBlock>(low + block, high + block, slack + block, stride_, all, nearer)) continue;
    for (size_t i = 0; i < kBlock && block + i < sites_.groups; ++i) {
      if (nearer[i] > 0) batch->groups[batch->group_count++] = static_cast<uint16_t>(block + i);
    }
  }
  return static_cast<uint32_t>(1 + sites_.groups / kBlock + batch->count * batch->group_count / 2);
}

bool NearFaces::MayCross(const Surface& surface, const TriangleBatch& batch, size_t index, size_t group,
                         bool (&may)[kNearestGroup]) const {
  const Box& box = batch.boxes[index];
  const float *bounds = sites_.bounds + group, *site = sites_.sites + group * kNearestSiteFloats * kNearestGroup;
  float nearer[kNearestGroup];
  if (!Meet<1>(bounds + kernels::kLow * stride_, bounds + kernels::kHigh * stride_, bounds + kernels::kSlack * stride_,
               stride_, box, nearer)) {
    return false;
  }
  if (!Meet<kNearestGroup>(site, site, site + 7 * kNearestGroup, kNearestGroup, box, nearer)) return false;
  const float *normal = site + 3 * kNearestGroup, *offset = site + 6 * kNearestGroup;
  float lowest[kNearestGroup];
  for (size_t k = 0; k < 3; ++k) {
    const float* p = surface.PositionOf(batch.faces[index][k]);
    for (size_t i = 0; i < kNearestGroup; ++i) {
      const float height =
          normal[i] * p[0] + normal[kNearestGroup + i] * p[1] + normal[2 * kNearestGroup + i] * p[2] - offset[i];
      lowest[i] = k == 0 || height < lowest[i] ? height : lowest[i];
    }
  }
  for (size_t i = 0; i < kNearestGroup; ++i) may[i] = nearer[i] > 0 && !(lowest[i] + clearance_ > 0);
  return true;
}

}  // namespace dcloth::engine
