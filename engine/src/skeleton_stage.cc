#include "engine/src/skeleton_stage.h"

namespace dcloth::engine {

SkeletonScratch PlaceSkeletonScratch(const format::SkeletonStageView& stage, Arena* arena) {
  const size_t gates = kernels::PaddedColumns(size_t{3} * stage.units);
  SkeletonScratch scratch;
  scratch.gx = arena->Take<float>(gates);
  scratch.gh = arena->Take<float>(gates);
  return scratch;
}

LinearProduct SkeletonInput(const format::SkeletonStageView& stage, const float* x, const SkeletonScratch& scratch,
                            int16_t* quantized) {
  return {&stage.input, x, stage.input.rows, Activation::kNone, quantized, scratch.gx};
}

LinearProduct SkeletonHidden(const format::SkeletonStageView& stage, const float* h, const SkeletonScratch& scratch,
                             int16_t* quantized) {
  return {&stage.hidden, h, stage.units, Activation::kNone, quantized, scratch.gh};
}

void RunSkeletonGates(const kernels::KernelTable& kernels, const format::SkeletonStageView& stage,
                      const SkeletonScratch& scratch, float* h) {
  kernels.gru_gates({scratch.gx, scratch.gh, h, stage.units});
}

}  // namespace dcloth::engine
