// The displacement of a tick: from the stages' P and Q to coefficients c, and c . basis (NETWORK.md, "Reduced basis").
//
// One block of coefficients per instance: [P, pad | Q, pad | c, pad]. Without a head c is [P, pad | Q] itself and takes
// no room.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_DISPLACEMENT_H_
#define DCLOTH_ENGINE_SRC_NETWORK_DISPLACEMENT_H_

#include "engine/src/network/linear.h"

namespace dcloth::engine {

// Floats of the block: Q's product and the head's write whole panels.
size_t CoefficientFloats(const format::ModelView& model);

// Where Q begins; P begins at 0 and is the skeleton stage's state.
size_t MeshCoefficientsAt(const format::ModelView& model);

// Where c begins with a head.
size_t MixedCoefficientsAt(const format::ModelView& model);

// What the basis multiplies.
const float* BasisCoefficients(const format::ModelView& model, const float* coefficients);

// Makes them, once P and, with the mesh stage, Q are there: c = P head + Q, or zeros where P and Q are padded. P and Q
// are kept. `stages` is one of DCLOTH_STAGES_* but STATIC; without the mesh stage Q is not read.
// Cost: k_S x r multiply-adds, under a hundredth of the basis sum.
void MixCoefficients(const kernels::KernelTable& kernels, const format::ModelView& model, uint32_t stages,
                     float* coefficients, int16_t* quantized);

// Floats of a displacement [n, 3], padded to whole panels; 0 where no stage makes one.
size_t DisplacementFloats(const format::ModelView& model);

// delta = c . basis, one pass over the part of the basis that the running stages use. `stages` is one of
// DCLOTH_STAGES_* but STATIC, whose displacement is zero; `coefficients` is the block, mixed; nothing of it beyond the
// level's rows is read.
LinearProduct DisplacementProduct(const format::ModelView& model, uint32_t stages, const float* coefficients,
                                  int16_t* quantized, float* displacement);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_DISPLACEMENT_H_
