#include "engine/src/network/mesh_stage.h"

#include <cstring>

namespace dcloth::engine {
namespace {

using format::MeshLayerView;
using format::MeshStageView;
using format::ModelView;

constexpr size_t kPointStride = kernels::GsgruInputStride(3);

size_t LayerStateFloats(const ModelView& model) {
  return kernels::GsgruStateFloats(model.vertex_count, model.mesh_stage.feature_width);
}

// Vertices [begin, end) of a portion of blocks.
struct Portion {
  size_t begin, count;
};

Portion VerticesOf(const ModelView& model, size_t begin_block, size_t block_count) {
  const size_t n = model.vertex_count, begin = begin_block * kernels::kGsgruBlock;
  const size_t end = (begin_block + block_count) * kernels::kGsgruBlock;
  return {begin, (end < n ? end : n) - begin};
}

// What a block of the last layer asks for of the weights after it. 1 KB is half a megabyte for the skirt, on a core
// with 2 MB of L2: its product takes 34 us instead of 58 with emptied caches, 20 instead of 29 without, the layers no
// more. Half as much gains half; all of it, or from the first layer on, costs the layers what it gains
// (kernels/README.md).
constexpr size_t kBlockAheadBytes = 1024;

size_t LastLayerShare(const MeshStageView& stage, size_t blocks) {
  const size_t all = PanelBytes(stage.hidden, stage.hidden.rows) * kernels::PanelCount(stage.hidden.columns) / blocks;
  return all < kBlockAheadBytes ? all : kBlockAheadBytes;
}

// Rows, state and outputs start at the portion; inputs are looked up over the whole mesh.
kernels::GsgruJob LayerJob(const ModelView& model, size_t index, const MeshMemory& memory, const Portion& portion) {
  const MeshStageView& stage = model.mesh_stage;
  const MeshLayerView& layer = stage.layers[index];
  const bool last = index + 1 == stage.layer_count;
  const size_t row = portion.begin * stage.feature_width;
  kernels::GsgruJob job = {};
  job.x = MeshLayerInput(memory, index);
  job.row_starts = stage.row_starts + portion.begin;
  job.columns = stage.columns;
  job.input_gates = layer.input_gates;
  job.gate_bias = layer.gate_bias;
  job.hidden_gates = layer.hidden_gates;
  job.hidden_candidate = layer.hidden_candidate;
  job.output = layer.output;
  job.output_bias = layer.output_bias;
  job.norm_gain = layer.norm_gain;
  job.norm_offset = layer.norm_offset;
  job.embed = last ? stage.embed : nullptr;
  job.state = memory.state + index * LayerStateFloats(model) + row;
  job.next_x = last ? nullptr : MeshLayerInput(memory, index + 1) + row;
  job.s = last ? memory.embedded + portion.begin : nullptr;
  job.scratch = memory.layer;
  job.vertices = portion.count;
  job.input_width = index == 0 ? 3 : stage.feature_width;
  job.features = stage.feature_width;
  job.prelu_slope = layer.prelu_slope;
  job.embed_bias = stage.embed_bias;
  return job;
}

size_t LayerScratchFloats(const MeshStageView& stage) {
  for (uint32_t l = 0; l < stage.layer_count; ++l) {
    if (stage.layers[l].integers != nullptr) return kernels::GsgruI8ScratchFloats(stage.feature_width);
  }
  return kernels::GsgruScratchFloats(stage.feature_width);
}

}  // namespace

MeshMemory PlaceMeshMemory(const ModelView& model, Arena* arena) {
  const MeshStageView& stage = model.mesh_stage;
  const size_t n = model.vertex_count, width = stage.feature_width, layers = stage.layer_count;
  MeshMemory memory = {};
  if (layers == 0) return memory;
  memory.state = arena->Take<float>(layers * LayerStateFloats(model));
  memory.matrices = arena->Take<float>(size_t{12} * model.joint_count);
  memory.even = arena->Take<float>(n * (layers > 2 ? width : kPointStride));
  memory.odd = arena->Take<float>(layers > 1 ? n * width : 0);
  memory.layer = arena->Take<float>(LayerScratchFloats(stage));
  memory.embedded = arena->Take<float>(n);
  memory.hidden = arena->Take<float>(kernels::PaddedColumns(stage.hidden.columns));
  return memory;
}

void ClearMeshState(const ModelView& model, const MeshMemory& memory) {
  const size_t floats = model.mesh_stage.layer_count * LayerStateFloats(model);
  if (floats != 0) std::memset(memory.state, 0, floats * sizeof(float));
}

// X: body points in the heading frame, standardised. Both are folded into the joint matrices,
// diag(1/deviation) (H^-1 G_j B_j^-1 - mean), which is exact because a point's weights sum to 1.
void PrepareBodyPoints(const ModelView& model, const SkinPose& skin, const Heading& heading, const MeshMemory& memory) {
  const MeshStageView& stage = model.mesh_stage;
  for (size_t j = 0; j < model.joint_count; ++j) {
    Affine matrix = ToHeading(heading, skin.joints[j]);
    for (int r = 0; r < 3; ++r) {
      matrix.m[r][3] -= static_cast<double>(stage.input_mean[r]);
      for (double& element : matrix.m[r]) element *= static_cast<double>(stage.input_inverse_deviation[r]);
    }
    StoreFloats(matrix, memory.matrices + 12 * j);
  }
}

size_t MeshBlocks(const ModelView& model) {
  return (model.vertex_count + kernels::kGsgruBlock - 1) / kernels::kGsgruBlock;
}

void PoseBodyPoints(const kernels::KernelTable& kernels, const ModelView& model, const MeshMemory& memory,
                    size_t begin_block, size_t block_count) {
  const MeshStageView& stage = model.mesh_stage;
  const Portion portion = VerticesOf(model, begin_block, block_count);
  kernels::SkinningJob job = {};
  job.matrices = memory.matrices;
  job.positions = stage.body_points + 3 * portion.begin;
  job.bones = stage.body_joints + stage.body_influences * portion.begin;
  job.weights = stage.body_weights + stage.body_influences * portion.begin;
  job.out = memory.even + kPointStride * portion.begin;
  job.out_stride_bytes = kPointStride * sizeof(float);
  job.vertices = portion.count;
  job.influences = stage.body_influences;
  kernels.skinning(job);
}

void RunMeshLayers(const kernels::KernelTable& kernels, const ModelView& model, const MeshMemory& memory,
                   size_t begin_block, size_t block_count) {
  const MeshStageView& stage = model.mesh_stage;
  const size_t blocks = MeshBlocks(model), share = LastLayerShare(stage, blocks);
  while (block_count > 0) {
    const size_t layer = begin_block / blocks, first = begin_block % blocks;
    const size_t count = block_count < blocks - first ? block_count : blocks - first;
    kernels::GsgruJob job = LayerJob(model, layer, memory, VerticesOf(model, first, count));
    if (layer + 1 == stage.layer_count) {
      job.block_ahead_bytes = share;
      job.ahead = static_cast<const uint8_t*>(stage.hidden.weights) + first * share;
    }
    const MeshLayerView& view = stage.layers[layer];
    if (view.integers == nullptr) {
      kernels.gsgru(job);
    } else {
      kernels.gsgru_i8({job, view.integers, view.column_scales, view.input_inverse_steps});
    }
    begin_block += count;
    block_count -= count;
  }
}

LinearProduct MeshHidden(const MeshStageView& stage, const MeshMemory& memory, int16_t* quantized) {
  return {&stage.hidden, memory.embedded, stage.hidden.rows, Activation::kRelu, quantized, memory.hidden};
}

LinearProduct MeshCoefficients(const MeshStageView& stage, const MeshMemory& memory, int16_t* quantized,
                               float* coefficients) {
  return {&stage.coefficients, memory.hidden, stage.coefficients.rows, Activation::kNone, quantized, coefficients};
}

}  // namespace dcloth::engine
