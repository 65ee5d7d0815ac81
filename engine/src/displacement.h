// delta = [P; Q] . [S; M] (NETWORK.md): one pass over the part of the basis that the running stages use.
#ifndef DCLOTH_ENGINE_SRC_DISPLACEMENT_H_
#define DCLOTH_ENGINE_SRC_DISPLACEMENT_H_

#include "engine/src/linear.h"

namespace dcloth::engine {

// Floats of the coefficients [P, pad, Q, pad]: Q's product writes whole panels.
size_t CoefficientFloats(const format::ModelView& model);

// Floats of a displacement [n, 3], padded to whole panels; 0 without a basis.
size_t DisplacementFloats(const format::ModelView& model);

// `stages` is one of DCLOTH_STAGES_* but STATIC, whose displacement is zero; nothing of the coefficients
// beyond its rows is read.
LinearProduct DisplacementProduct(const format::ModelView& model, uint32_t stages, const float* coefficients,
                                  int16_t* quantized, float* displacement);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_DISPLACEMENT_H_
