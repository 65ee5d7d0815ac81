#include "engine/src/displacement.h"

#include <cstring>

#include "dcloth/dcloth.h"
#include "engine/src/coefficients.h"

namespace dcloth::engine {

size_t DisplacementFloats(const format::ModelView& model) {
  return model.displacement.skeleton_rows == 0 ? 0 : kernels::PaddedColumns(model.displacement.basis.columns);
}

void RunDisplacement(const kernels::KernelTable& kernels, const format::ModelView& model, uint32_t stages,
                     float* coefficients, int16_t* quantized, float* displacement) {
  const format::DisplacementView& view = model.displacement;
  if (view.skeleton_rows == 0) return;
  if (stages == DCLOTH_STAGES_STATIC) {
    std::memset(displacement, 0, DisplacementFloats(model) * sizeof(float));
    return;
  }
  MixCoefficients(kernels, model, stages, coefficients, quantized);
  const size_t rows = view.skeleton_rows + (stages == DCLOTH_STAGES_MESH ? view.mesh_rows : 0);
  ApplyLinear(kernels, view.basis, BasisCoefficients(model, coefficients), rows, Activation::kNone, quantized,
              displacement);
}

}  // namespace dcloth::engine
