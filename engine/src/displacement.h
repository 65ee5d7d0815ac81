// delta = c . basis (NETWORK.md): one pass over the part of the basis that the running stages use.
#ifndef DCLOTH_ENGINE_SRC_DISPLACEMENT_H_
#define DCLOTH_ENGINE_SRC_DISPLACEMENT_H_

#include "engine/src/linear.h"

namespace dcloth::engine {

// Floats of a displacement [n, 3], padded to whole panels; 0 without a basis.
size_t DisplacementFloats(const format::ModelView& model);

// `stages` is one of DCLOTH_STAGES_* but STATIC, whose displacement is zero; `coefficients` is
// the block of coefficients.h, mixed; nothing of it beyond the level's rows is read.
LinearProduct DisplacementProduct(const format::ModelView& model, uint32_t stages, const float* coefficients,
                                  int16_t* quantized, float* displacement);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_DISPLACEMENT_H_
