#include "engine/src/network/pose_stages.h"

namespace dcloth::engine {
SkeletonScratch PlaceSkeletonScratch(const format::SkeletonStageView& stage, Arena* arena) {
  const size_t gates = kernels::PaddedColumns(size_t{3} * stage.units);
  SkeletonScratch scratch;
  scratch.gx = arena->Take<float>(gates);
  scratch.gh = arena->Take<float>(gates);
  const size_t rest = QuantizedElements(stage.hidden);
  scratch.rest.x = arena->Take<float>(rest);
  scratch.rest.quantized = arena->Take<int16_t>(rest);
  return scratch;
}

LinearProduct SkeletonInput(const format::SkeletonStageView& stage, const float* x, const SkeletonScratch& scratch,
                            int16_t* quantized) {
  return {&stage.input, x, stage.input.rows, Activation::kNone, quantized, scratch.gx};
}

LinearProduct SkeletonHidden(const format::SkeletonStageView& stage, const float* h, const SkeletonScratch& scratch,
                             int16_t* quantized) {
  LinearProduct product = {&stage.hidden, h, stage.units, Activation::kNone, quantized, scratch.gh};
  product.rest = scratch.rest;
  return product;
}

void RunSkeletonGates(const kernels::KernelTable& kernels, const format::SkeletonStageView& stage,
                      const SkeletonScratch& scratch, float* h) {
  kernels.gru_gates({scratch.gx, scratch.gh, h, stage.units});
}

size_t IncrementFloats(const format::StaticStageView& stage) {
  return kernels::PaddedColumns(stage.increments.columns);
}

void RunStaticStage(const kernels::KernelTable& kernels, const format::StaticStageView& stage, const float* x,
                    float* hidden, int16_t* quantized, float* increments) {
  ApplyLinear(kernels, {&stage.hidden, x, stage.hidden.rows, Activation::kRelu, quantized, hidden});
  ApplyLinear(kernels, {&stage.increments, hidden, stage.increments.rows, Activation::kNone, quantized, increments});
}

}  // namespace dcloth::engine
