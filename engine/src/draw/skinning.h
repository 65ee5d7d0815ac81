// Linear blend skinning of the displaced template with moved pivots (NETWORK.md, "Static stage").
#ifndef DCLOTH_ENGINE_SRC_DRAW_SKINNING_H_
#define DCLOTH_ENGINE_SRC_DRAW_SKINNING_H_

#include "engine/src/draw/output.h"
#include "engine/src/pose/pose.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

// Two ticks to blend between, from = [0], to = [1].
struct TickPair {
  const float* increments[2];    // D [m, 3]
  const float* displacement[2];  // delta [n, 3]; null without a basis
  float blend;
};

// Writes positions in the host's space relative to the hips, so that floats stay fine wherever the character
// is. `matrices` is scratch of [m, 12] floats.
void SkinRelative(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                  const SkinPose& skin, const TickPair& ticks, float* matrices, const DrawnMesh& mesh,
                  const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_DRAW_SKINNING_H_
