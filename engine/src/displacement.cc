#include "engine/src/displacement.h"

#include "dcloth/dcloth.h"

namespace dcloth::engine {

size_t CoefficientFloats(const format::ModelView& model) {
  return model.displacement.skeleton_rows + kernels::PaddedColumns(model.mesh_stage.coefficients.columns);
}

size_t DisplacementFloats(const format::ModelView& model) {
  return model.displacement.skeleton_rows == 0 ? 0 : kernels::PaddedColumns(model.displacement.basis.columns);
}

LinearProduct DisplacementProduct(const format::ModelView& model, uint32_t stages, const float* coefficients,
                                  int16_t* quantized, float* displacement) {
  const format::DisplacementView& view = model.displacement;
  const size_t rows = view.skeleton_rows + (stages == DCLOTH_STAGES_MESH ? view.mesh_rows : 0);
  return {&view.basis, coefficients, rows, Activation::kNone, quantized, displacement};
}

}  // namespace dcloth::engine
