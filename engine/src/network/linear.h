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

// What rounding to 16 bits leaves of an input whose product is fed back from tick to tick; one rounding alone moves a
// garment at rest by up to 0.015 mm a tick. It is multiplied as integers too: the weights are read once.
struct InputRest {
  float* x;            // [row_count]
  int16_t* quantized;  // as LinearProduct::quantized
};

// Scales of an input's integers and of its rest's.
struct InputScales {
  float x = 1.0f;
  float rest = 1.0f;
};

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
  InputRest rest = {};    // int8 weights: x in twice 16 bits; null for once
};

// Returns the scales of the integers, which ApplyPanels wants back. With float weights nothing is written.
InputScales QuantizeInput(const kernels::KernelTable& kernels, const LinearProduct& product);

// Panels [begin, begin + count) of y. A panel's result does not depend on which others are computed with it,
// so a product may be spread over calls.
void ApplyPanels(const kernels::KernelTable& kernels, const LinearProduct& product, const InputScales& scales,
                 size_t begin, size_t count);

// The same into `out`, which has room for these panels alone; y is not used.
void ApplyPanelsTo(const kernels::KernelTable& kernels, const LinearProduct& product, const InputScales& scales,
                   size_t begin, size_t count, float* out);

// The whole product at once.
void ApplyLinear(const kernels::KernelTable& kernels, const LinearProduct& product);

// The same layer for `count` inputs, whose rows lie a stride apart: the weights are read once for all of them.
struct LinearBatch {
  const format::LinearView* linear;
  const float* x;  // [count] rows of [rows]
  size_t x_stride;
  size_t count;
  Activation activation;
  int16_t* quantized;  // [count, QuantizedElements]
  float* scales;       // [count], with int8 weights
  float* y;            // [count] rows of all padded columns
  size_t y_stride;
};

// The bits are those of ApplyLinear on each input.
void ApplyBatch(const kernels::KernelTable& kernels, const LinearBatch& batch);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_LINEAR_H_
