// Static stage (NETWORK.md): pivot increments from the pose alone. Keeps no state.
#ifndef DCLOTH_ENGINE_SRC_STATIC_STAGE_H_
#define DCLOTH_ENGINE_SRC_STATIC_STAGE_H_

#include "engine/src/arena.h"
#include "engine/src/linear.h"

namespace dcloth::engine {

// Floats of an increments array: D [m, 3], padded to whole panels.
size_t IncrementFloats(const format::StaticStageView& stage);

// D = W_2 ReLU(W_1 x + b_1) + b_2. `hidden` is scratch for the padded width.
void RunStaticStage(const kernels::KernelTable& kernels, const format::StaticStageView& stage, const float* x,
                    float* hidden, int16_t* quantized, float* increments);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_STATIC_STAGE_H_
