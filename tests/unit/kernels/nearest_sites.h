// Sites in lumps of 16 that overlap, with planes through or near them, as the nearest job wants them.
#ifndef DCLOTH_TESTS_UNIT_KERNELS_NEAREST_SITES_H_
#define DCLOTH_TESTS_UNIT_KERNELS_NEAREST_SITES_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {

struct Sites {
  // Slacks are up to `slack`.
  Sites(size_t wanted, float slack, Random* random)
      : count(wanted), groups((wanted + kNearestGroup - 1) / kNearestGroup) {
    for (size_t s = 0; s < count; ++s) {
      if (s % kNearestGroup == 0) {
        for (float& c : lump) c = random->Uniform(-1.0f, 1.0f);
      }
      double length = 0;
      for (size_t c = 0; c < 3; ++c) {
        position.push_back(lump[c] + random->Uniform(-0.2f, 0.2f));
        normal.push_back(lump[c] + random->Uniform(-0.3f, 0.3f));
        length += double{normal.back()} * normal.back();
      }
      double height = random->Uniform(-0.05f, 0.05f);
      for (size_t c = 0; c < 3; ++c) {
        normal[3 * s + c] = static_cast<float>(normal[3 * s + c] / std::sqrt(length));
        height += double{normal[3 * s + c]} * position[3 * s + c];
      }
      offset.push_back(static_cast<float>(height));
      const float own = slack * random->Uniform(0.0f, 1.0f);
      slack_squared.push_back(own * own);
    }
    Pack();
  }

  void Pack() {
    const size_t stride = NearestBoundStride(groups);
    packed.resize(groups * kNearestSiteFloats * kNearestGroup);
    bounds.resize(kNearestBounds * stride);
    for (size_t g = 0; g < stride; ++g) {
      for (size_t row = 0; row < kSlack; ++row) bounds[row * stride + g] = kNoGroup;
      if (g >= groups) continue;
      for (size_t k = 0; k < kNearestGroup; ++k) {
        const size_t s = std::min(g * kNearestGroup + k, count - 1);
        float* to = &packed[g * kNearestSiteFloats * kNearestGroup + k];
        for (size_t c = 0; c < 3; ++c) to[c * kNearestGroup] = position[3 * s + c];
        for (size_t c = 0; c < 3; ++c) to[(3 + c) * kNearestGroup] = normal[3 * s + c];
        to[6 * kNearestGroup] = offset[s];
        to[7 * kNearestGroup] = slack_squared[s];
      }
      Bound(g, &bounds[g], stride);
    }
  }

  void Bound(size_t g, float* to, size_t stride) {
    for (size_t s = g * kNearestGroup; s < std::min((g + 1) * kNearestGroup, count); ++s) {
      const bool first = s % kNearestGroup == 0;
      for (size_t c = 0; c < 3; ++c) {
        float &low = to[(kLow + c) * stride], &high = to[(kHigh + c) * stride];
        low = first ? position[3 * s + c] : std::min(low, position[3 * s + c]);
        high = first ? low : std::max(high, position[3 * s + c]);
      }
      to[kSlack * stride] = std::max(first ? 0.0f : to[kSlack * stride], slack_squared[s]);
    }
  }

  size_t count, groups;
  float lump[3] = {};
  std::vector<float> position, normal, offset, slack_squared, packed, bounds;
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_TESTS_UNIT_KERNELS_NEAREST_SITES_H_
