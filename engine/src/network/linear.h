// One linear layer of the model in whatever precision it is stored.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_LINEAR_H_
#define DCLOTH_ENGINE_SRC_NETWORK_LINEAR_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

enum class Activation : bool { kNone, kRelu };

// Elements of int16 scratch that `linear` needs: none for float weights.
size_t QuantizedElements(const format::LinearView& linear);

// Bytes of weights that a panel's product over `row_count` rows streams.
size_t PanelBytes(const format::LinearView& linear, size_t row_count);

// y = activation(x W + bias) over the first `row_count` rows of W, which is even where W is a basis. x holds
// row_count floats; y has room for all padded columns.
struct LinearProduct {
  const format::LinearView* linear;
  const float* x;
  size_t row_count;
  Activation activation;
  int16_t* quantized;  // x as int8 weights want it; stays valid from QuantizeInput to the last panel
  float* y;
  bool in_order = false;  // float weights: the same bits on every instruction set (kernels/matvec/matvec.h)
};

// Returns the scale of `quantized`, which ApplyPanels wants back; 1 with float weights, where nothing is
// written.
float QuantizeInput(const kernels::KernelTable& kernels, const LinearProduct& product);

// Panels [begin, begin + count) of y. A panel's result does not depend on which others are computed with it,
// so a product may be spread over calls.
void ApplyPanels(const kernels::KernelTable& kernels, const LinearProduct& product, float x_scale, size_t begin,
                 size_t count);

// The same into `out`, which has room for these panels alone; y is not used.
void ApplyPanelsTo(const kernels::KernelTable& kernels, const LinearProduct& product, float x_scale, size_t begin,
                   size_t count, float* out);

// The whole product at once.
void ApplyLinear(const kernels::KernelTable& kernels, const LinearProduct& product);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_LINEAR_H_
