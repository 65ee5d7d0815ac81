// Mesh stage (NETWORK.md): posed body points through the graph-recurrent layers and the vertex perceptron to Q.
#ifndef DCLOTH_ENGINE_SRC_MESH_STAGE_H_
#define DCLOTH_ENGINE_SRC_MESH_STAGE_H_

#include "engine/src/arena.h"
#include "engine/src/linear.h"
#include "engine/src/pose.h"

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

MeshMemory PlaceMeshMemory(const format::ModelView& model, Arena* arena);

void ClearMeshState(const format::ModelView& model, const MeshMemory& memory);

// Writes Q into all padded columns of `coefficients`.
void RunMeshStage(const kernels::KernelTable& kernels, const format::ModelView& model, const BoundPose& bound,
                  const Heading& heading, const MeshMemory& memory, int16_t* quantized, float* coefficients);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_MESH_STAGE_H_
