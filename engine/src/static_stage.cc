#include "engine/src/static_stage.h"

namespace dcloth::engine {

size_t IncrementFloats(const format::StaticStageView& stage) {
  return kernels::PaddedColumns(stage.increments.columns);
}

void RunStaticStage(const kernels::KernelTable& kernels, const format::StaticStageView& stage, const float* x,
                    float* hidden, int16_t* quantized, float* increments) {
  ApplyLinear(kernels, {&stage.hidden, x, stage.hidden.rows, Activation::kRelu, quantized, hidden});
  ApplyLinear(kernels, {&stage.increments, hidden, stage.increments.rows, Activation::kNone, quantized, increments});
}

}  // namespace dcloth::engine
