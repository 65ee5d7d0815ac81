#include "engine/src/state/state_layout.h"

#include "engine/src/network/displacement.h"
#include "engine/src/time/idle.h"
#include "engine/src/network/tick_work.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

void AddRow(const char* name, float* data, size_t count, StateSpans* spans) {
  spans->Add(name, data, 1, count, count, kLargestFloat);
}

// Between ticks. A stage that rests has no state: it starts from zero.
void ListKept(const Cloth& cloth, const StatePosition& at, StateSpans* spans) {
  const ModelView& model = *cloth.model;
  const size_t n = model.vertex_count, width = model.mesh_stage.feature_width;
  AddRow("features", cloth.features, model.features.length, spans);
  if (RunsSkeleton(at.plan)) {
    const size_t units = model.skeleton_stage.units;
    spans->Add("skeleton_state", cloth.coefficients, 1, units, units, kLargestHidden);
  }
  if (HasMesh(at.plan)) {
    for (size_t layer = 0; layer < model.mesh_stage.layer_count; ++layer) {
      spans->Add("mesh_state", cloth.mesh.state + layer * kernels::GsgruStateFloats(n, width), n, width, width,
                 kLargestHidden);
    }
    if (AtHalfRate(at.plan))
      AddRow("mesh_before", cloth.mesh_before, model.mesh_stage.coefficients.columns, spans);
  }
  if (at.idle_floats != 0) {
    const bool own = at.idle_floats == IdleStartFloats(model);
    AddRow("idle_start", own ? cloth.idle_start : nullptr, static_cast<size_t>(at.idle_floats), spans);
  }
  // A tick in work fills the oldest slot, whose rest a frame may still draw.
  const uint32_t slots = at.part == TickPart::kDone ? at.tick_count : kTickSlots;
  for (uint32_t back = 0; back < slots; ++back) {
    const uint32_t slot = (cloth.newest + kTickSlots - back) % kTickSlots;
    AddRow("increments", cloth.increments[slot], size_t{3} * model.static_stage.bone_count, spans);
    if (cloth.displacement[slot] != nullptr) AddRow("displacement", cloth.displacement[slot], 3 * n, spans);
  }
}

// Columns that panels done have filled, without padding.
size_t Filled(uint32_t panels, size_t columns) {
  const size_t filled = panels * kernels::kPanelColumns;
  return filled < columns ? filled : columns;
}

void ListSkeletonWork(const Cloth& cloth, const StatePosition& at, StateSpans* spans) {
  const size_t gates = size_t{3} * cloth.model->skeleton_stage.units;
  switch (at.part) {
    case TickPart::kSkeletonInput:
      AddRow("input_gates", cloth.skeleton.gx, Filled(at.items_done, gates), spans);
      break;
    case TickPart::kSkeletonHidden:
      AddRow("input_gates", cloth.skeleton.gx, gates, spans);
      AddRow("hidden_gates", cloth.skeleton.gh, Filled(at.items_done, gates), spans);
      break;
    case TickPart::kSkeletonGates:
      AddRow("input_gates", cloth.skeleton.gx, gates, spans);
      AddRow("hidden_gates", cloth.skeleton.gh, gates, spans);
      break;
    default:
      break;
  }
}

void ListMeshLayerWork(const Cloth& cloth, uint32_t items_done, StateSpans* spans) {
  const ModelView& model = *cloth.model;
  const MeshMemory& mesh = cloth.mesh;
  const size_t n = model.vertex_count, width = model.mesh_stage.feature_width;
  const size_t layer = items_done / MeshBlocks(model);
  const size_t begun = items_done % MeshBlocks(model) * kernels::kGsgruBlock;
  const size_t inputs = layer == 0 ? 3 : width;
  spans->Add("layer_input", MeshLayerInput(mesh, layer), n, inputs, kernels::GsgruInputStride(inputs), kLargestFloat);
  const size_t done = begun < n ? begun : n;
  if (layer + 1 == model.mesh_stage.layer_count) {
    AddRow("embedded", mesh.embedded, done, spans);
  } else {
    spans->Add("layer_output", MeshLayerInput(mesh, layer + 1), done, width, width, kLargestFloat);
  }
}

void ListMeshWork(const Cloth& cloth, const StatePosition& at, StateSpans* spans) {
  const ModelView& model = *cloth.model;
  const MeshMemory& mesh = cloth.mesh;
  const size_t n = model.vertex_count;
  if (RunsMesh(at.plan) && at.part <= TickPart::kBodyPoints)
    AddRow("body_matrices", mesh.matrices, size_t{12} * model.joint_count, spans);
  float* const q = cloth.coefficients + MeshCoefficientsAt(model);
  const size_t coefficients = model.mesh_stage.coefficients.columns;
  switch (at.part) {
    case TickPart::kBodyPoints: {
      const size_t done = at.items_done * kernels::kGsgruBlock;
      spans->Add("layer_input", MeshLayerInput(mesh, 0), done < n ? done : n, 3, kernels::GsgruInputStride(3),
                 kLargestFloat);
      break;
    }
    case TickPart::kMeshLayers:
      ListMeshLayerWork(cloth, at.items_done, spans);
      break;
    case TickPart::kMeshHidden:
      AddRow("embedded", mesh.embedded, n, spans);
      AddRow("mesh_hidden", mesh.hidden, Filled(at.items_done, model.mesh_stage.hidden.columns), spans);
      break;
    case TickPart::kMeshCoefficients:
      AddRow("mesh_hidden", mesh.hidden, model.mesh_stage.hidden.columns, spans);
      AddRow("mesh_coefficients", q, Filled(at.items_done, coefficients), spans);
      break;
    case TickPart::kCoefficients:
      if (RunsMesh(at.plan)) AddRow("mesh_coefficients", q, coefficients, spans);
      break;
    case TickPart::kDisplacement:
      if (model.displacement.head.rows == 0) AddRow("mesh_coefficients", q, coefficients, spans);
      break;
    default:
      break;
  }
}

}  // namespace

void StateSpans::Add(const char* name, float* data, size_t rows, size_t columns, size_t stride, float largest) {
  if (rows == 0 || columns == 0) return;
  const bool whole = stride == columns;
  spans[count++] = whole ? StateSpan{name, data, 1, rows * columns, rows * columns, largest}
                         : StateSpan{name, data, rows, columns, stride, largest};
}

size_t StateSpans::Floats() const {
  size_t floats = 0;
  for (uint32_t i = 0; i < count; ++i) floats += spans[i].rows * spans[i].columns;
  return floats;
}

void ListStateSpans(const Cloth& cloth, const StatePosition& position, StateSpans* spans) {
  if (position.tick_count == 0) return;
  ListKept(cloth, position, spans);
  if (position.part == TickPart::kDone) return;
  ListSkeletonWork(cloth, position, spans);
  if (HasMesh(position.plan)) ListMeshWork(cloth, position, spans);
  // Without a head no columns, and nothing is added.
  const size_t mixed = cloth.model->displacement.head.columns;
  if (position.part == TickPart::kDisplacement && RunsSkeleton(position.plan))
    AddRow("mixed_coefficients", cloth.coefficients + MixedCoefficientsAt(*cloth.model), mixed, spans);
}

}  // namespace dcloth::engine
