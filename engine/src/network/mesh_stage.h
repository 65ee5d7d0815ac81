// Mesh stage (NETWORK.md): posed body points through the graph-recurrent layers and the vertex perceptron to Q.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_MESH_STAGE_H_
#define DCLOTH_ENGINE_SRC_NETWORK_MESH_STAGE_H_

#include "engine/src/base/lent_memory.h"
#include "engine/src/network/linear.h"
#include "engine/src/pose/pose.h"

namespace dcloth::engine {

struct MeshMemory {
  float* state;     // [layer_count][GsgruStateFloats(n, F)], the only part that outlives a tick
  float* matrices;  // [joint_count, 12]
  float* even;      // input of even layers: [n, 4] of the first, [n, F] later
  float* odd;       // input of odd layers, [n, F]; empty with one layer
  float* layer;     // the kernel's scratch
  float* embedded;  // s [n]
  float* hidden;    // [padded h]
};

// Input rows of a layer, GsgruInputStride apart, which the layer before writes.
inline float* MeshLayerInput(const MeshMemory& memory, size_t layer) {
  return layer % 2 == 0 ? memory.even : memory.odd;
}

MeshMemory PlaceMeshMemory(const format::ModelView& model, Arena* arena);

void ClearMeshState(const format::ModelView& model, const MeshMemory& memory);

// The stage's steps in order. Layers and body points are cut into blocks of kGsgruBlock vertices, which may
// be run in any portions from the first to the last; nothing of the pose is needed after the first step.
void PrepareBodyPoints(const format::ModelView& model, const SkinPose& skin, const Heading& heading,
                       const MeshMemory& memory);
size_t MeshBlocks(const format::ModelView& model);  // of a layer
void PoseBodyPoints(const kernels::KernelTable& kernels, const format::ModelView& model, const MeshMemory& memory,
                    size_t begin_block, size_t block_count);
// Blocks are counted through all layers: layer l starts at l MeshBlocks. The last layer asks for the weights of the
// product after it.
void RunMeshLayers(const kernels::KernelTable& kernels, const format::ModelView& model, const MeshMemory& memory,
                   size_t begin_block, size_t block_count);
LinearProduct MeshHidden(const format::MeshStageView& stage, const MeshMemory& memory, int16_t* quantized);
// Writes Q into all padded columns of `coefficients`.
LinearProduct MeshCoefficients(const format::MeshStageView& stage, const MeshMemory& memory, int16_t* quantized,
                               float* coefficients);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_MESH_STAGE_H_
