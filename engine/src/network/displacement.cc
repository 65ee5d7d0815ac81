#include "engine/src/network/displacement.h"

#include "dcloth/dcloth.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

bool HasHead(const ModelView& model) { return model.displacement.head.rows != 0; }

// Pad coefficients meet pad rows of the basis; both are zero in a sound file, and this keeps one of them so in any.
void ClearPads(const ModelView& model, float* coefficients) {
  const uint32_t units = model.skeleton_stage.units, columns = model.mesh_stage.coefficients.columns;
  if (units % 2 != 0) coefficients[units] = 0.0f;
  if (columns % 2 != 0) coefficients[MeshCoefficientsAt(model) + columns] = 0.0f;
}

}  // namespace

size_t MeshCoefficientsAt(const ModelView& model) { return kernels::PairedRows(model.skeleton_stage.units); }

size_t MixedCoefficientsAt(const ModelView& model) {
  return MeshCoefficientsAt(model) + kernels::PaddedColumns(model.mesh_stage.coefficients.columns);
}

size_t CoefficientFloats(const ModelView& model) {
  return MixedCoefficientsAt(model) + (HasHead(model) ? kernels::PaddedColumns(model.displacement.head.columns) : 0);
}

const float* BasisCoefficients(const ModelView& model, const float* coefficients) {
  return HasHead(model) ? coefficients + MixedCoefficientsAt(model) : coefficients;
}

void MixCoefficients(const kernels::KernelTable& kernels, const ModelView& model, uint32_t stages, float* coefficients,
                     int16_t* quantized) {
  if (!HasHead(model)) {
    ClearPads(model, coefficients);
    return;
  }
  const format::LinearView& head = model.displacement.head;
  float* mixed = coefficients + MixedCoefficientsAt(model);
  // In order: an int8 basis rounds c to integers, where a last bit may move a whole step.
  ApplyLinear(kernels, {&head, coefficients, head.rows, Activation::kNone, quantized, mixed, /*in_order=*/true});
  if (stages != DCLOTH_STAGES_MESH) return;
  const float* q = coefficients + MeshCoefficientsAt(model);
  for (uint32_t i = 0; i < head.columns; ++i) mixed[i] += q[i];
}

size_t DisplacementFloats(const format::ModelView& model) {
  const bool moves = model.displacement.skeleton_rows != 0 || model.patch_stage.patch_count != 0;
  return moves ? kernels::PaddedColumns(size_t{3} * model.vertex_count) : 0;
}

LinearProduct DisplacementProduct(const format::ModelView& model, uint32_t stages, const float* coefficients,
                                  int16_t* quantized, float* displacement) {
  const format::DisplacementView& view = model.displacement;
  const size_t rows = view.skeleton_rows + (stages == DCLOTH_STAGES_MESH ? view.mesh_rows : 0);
  return {&view.basis, BasisCoefficients(model, coefficients), rows, Activation::kNone, quantized, displacement};
}

}  // namespace dcloth::engine
