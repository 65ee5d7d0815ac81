// The stages that read the pose's features (NETWORK.md): the static stage's pivot increments, which keep no state, and
// the skeleton stage's GRU step, whose state h is the coefficients P and lies where the basis reads them.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_POSE_STAGES_H_
#define DCLOTH_ENGINE_SRC_NETWORK_POSE_STAGES_H_

#include "engine/src/base/lent_memory.h"
#include "engine/src/network/linear.h"

namespace dcloth::engine {

struct SkeletonScratch {
  float* gx;       // [padded 3 k]
  float* gh;       // [padded 3 k]
  InputRest rest;  // of h
};

SkeletonScratch PlaceSkeletonScratch(const format::SkeletonStageView& stage, Arena* arena);

// The two products, in either order, then the gates, which move h to h'.
LinearProduct SkeletonInput(const format::SkeletonStageView& stage, const float* x, const SkeletonScratch& scratch,
                            int16_t* quantized);
LinearProduct SkeletonHidden(const format::SkeletonStageView& stage, const float* h, const SkeletonScratch& scratch,
                             int16_t* quantized);
void RunSkeletonGates(const kernels::KernelTable& kernels, const format::SkeletonStageView& stage,
                      const SkeletonScratch& scratch, float* h);

// Floats of an increments array: D [m, 3], padded to whole panels.
size_t IncrementFloats(const format::StaticStageView& stage);

// D = W_2 ReLU(W_1 x + b_1) + b_2. `hidden` is scratch for the padded width.
void RunStaticStage(const kernels::KernelTable& kernels, const format::StaticStageView& stage, const float* x,
                    float* hidden, int16_t* quantized, float* increments);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_POSE_STAGES_H_
