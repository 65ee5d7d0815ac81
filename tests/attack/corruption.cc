#include "tests/attack/corruption.h"

namespace dcloth::testing {
namespace {

TestModel Sound(const Corruption& corruption) {
  ModelSpec spec;
  spec.precision = corruption.precision;
  spec.mesh = corruption.stages == DCLOTH_STAGES_MESH;
  spec.skeleton = corruption.stages != DCLOTH_STAGES_STATIC;
  spec.integer_layers = corruption.integer_layers;
  spec.body = spec.touch = corruption.touch;
  spec.coarse = corruption.coarse;
  spec.texture = corruption.texture;
  spec.rank = corruption.rank;
  spec.patches = corruption.patches;
  return BuildModel(spec);
}

}  // namespace

std::unique_ptr<format::TensorT> Copy(const format::TensorT& tensor) {
  auto copy = std::make_unique<format::TensorT>();
  copy->dtype = tensor.dtype;
  copy->shape = tensor.shape;
  copy->offset = tensor.offset;
  return copy;
}

std::unique_ptr<format::MeshLayerT> Copy(const format::MeshLayerT& layer) {
  auto copy = std::make_unique<format::MeshLayerT>();
  const auto copy_present = [](const std::unique_ptr<format::TensorT>& tensor) {
    return tensor ? Copy(*tensor) : nullptr;
  };
  copy->input_gates = copy_present(layer.input_gates);
  copy->gate_bias = Copy(*layer.gate_bias);
  copy->hidden_gates = copy_present(layer.hidden_gates);
  copy->hidden_candidate = copy_present(layer.hidden_candidate);
  copy->output = copy_present(layer.output);
  copy->output_bias = Copy(*layer.output_bias);
  copy->norm_gain = Copy(*layer.norm_gain);
  copy->norm_offset = Copy(*layer.norm_offset);
  copy->prelu_slope = layer.prelu_slope;
  copy->weights = copy_present(layer.weights);
  copy->column_scales = copy_present(layer.column_scales);
  copy->input_inverse_steps = copy_present(layer.input_inverse_steps);
  return copy;
}

AlignedBytes SoundTwin(const Corruption& corruption) { return Sound(corruption).Bytes(); }

AlignedBytes Corrupted(const Corruption& corruption) {
  TestModel model = Sound(corruption);
  if (corruption.tables) corruption.tables(model.tables.get());
  AlignedBytes bytes = model.Bytes();
  if (corruption.bytes) corruption.bytes(&bytes);
  return bytes;
}

}  // namespace dcloth::testing
