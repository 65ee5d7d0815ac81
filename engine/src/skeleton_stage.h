// Skeleton stage (NETWORK.md): one GRU step. Its state h is the coefficients P and lies where the basis reads them.
#ifndef DCLOTH_ENGINE_SRC_SKELETON_STAGE_H_
#define DCLOTH_ENGINE_SRC_SKELETON_STAGE_H_

#include "engine/src/arena.h"
#include "engine/src/linear.h"

namespace dcloth::engine {

struct SkeletonScratch {
  float* gx;  // [padded 3 k]
  float* gh;  // [padded 3 k]
};

SkeletonScratch PlaceSkeletonScratch(const format::SkeletonStageView& stage, Arena* arena);

// The two products, in either order, then the gates, which move h to h'.
LinearProduct SkeletonInput(const format::SkeletonStageView& stage, const float* x, const SkeletonScratch& scratch,
                            int16_t* quantized);
LinearProduct SkeletonHidden(const format::SkeletonStageView& stage, const float* h, const SkeletonScratch& scratch,
                             int16_t* quantized);
void RunSkeletonGates(const kernels::KernelTable& kernels, const format::SkeletonStageView& stage,
                      const SkeletonScratch& scratch, float* h);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_SKELETON_STAGE_H_
