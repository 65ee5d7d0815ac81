// One linear layer of the model in whatever precision it is stored.
#ifndef DCLOTH_ENGINE_SRC_LINEAR_H_
#define DCLOTH_ENGINE_SRC_LINEAR_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

enum class Activation : bool { kNone, kRelu };

// Elements of int16 scratch that ApplyLinear needs for `linear`: none for float weights.
size_t QuantizedElements(const format::LinearView& linear);

// y = activation(x W + bias) over the first `row_count` rows of W, which is even where W is a basis. Writes all padded
// columns of y. x holds row_count floats.
void ApplyLinear(const kernels::KernelTable& kernels, const format::LinearView& linear, const float* x,
                 size_t row_count, Activation activation, int16_t* quantized, float* y);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_LINEAR_H_
