// Patch stage (NETWORK.md): one GRU on a coarse graph of patches, and the map from their points to vertices.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_PATCH_STAGE_H_
#define DCLOTH_ENGINE_SRC_NETWORK_PATCH_STAGE_H_

#include "engine/src/base/lent_memory.h"
#include "engine/src/network/linear.h"
#include "engine/src/network/patch_inputs.h"
#include "engine/src/pose/pose.h"

namespace dcloth::engine {

// K patches of R points, P = K R; C capsules; W features; I inputs; J joints.
struct PatchMemory {
  // What outlives a tick.
  float* cloth;   // [PatchClothFloats]: u, x_1, x_2 [K][3][R] each, c_1, c_2 [K, 3] each, ends of capsules [C, 6],
                  // ticks since the body moved
  float* hidden;  // h [K, W]
  // What is made of the pose when a tick begins, and from it.
  float* pose;      // [PatchPoseFloats]
  float* frames;    // [K, PatchFrameFloats]
  float* rows;      // [K, W + I]: h' and x, what `out` reads
  float* features;  // f [K, PaddedColumns(W)]
  // Scratch of a layer.
  float* products[2];  // [K, what the widest layer makes]
  float* mixed;        // [K, (1 + S) W], where products[1] lies
  int16_t* quantized;  // [K, widest int8 layer, or 3 R]
  float* scales;       // [K]
};

size_t PatchClothFloats(const format::PatchStageView& stage);
size_t PatchPoseFloats(const format::ModelView& model);
size_t PatchRowFloats(const format::PatchStageView& stage);

PatchMemory PlacePatchMemory(const format::ModelView& model, Arena* arena);

void ClearPatchState(const format::PatchStageView& stage, const PatchMemory& memory);

// How the character got to this tick.
struct PatchMotion {
  double hips_way[3];    // since the last tick, metres
  double wind[3];        // metres a tick
  double elapsed_ticks;  // since the last tick; less than 1 counts as 1
  bool carried;          // by a jump; or there is no last tick, and the state is clear
};

// The stage's steps in order; nothing of the pose is needed after the first one. Items of each may be run in any
// portions, from the first to the last.
void PreparePatches(const format::ModelView& model, const SkinPose& skin, const PatchMotion& motion,
                    const PatchMemory& memory);
// An item is a patch.
void ReadPatches(const format::ModelView& model, const PatchMemory& memory, size_t begin, size_t count);
// An item is a layer of all patches: enter, each mix, the gates, out. The last one moves the state to this tick.
size_t PatchLayerItems(const format::PatchStageView& stage);
void RunPatchLayers(const kernels::KernelTable& kernels, const format::ModelView& model, const PatchMemory& memory,
                    size_t begin, size_t count);
// An item is kMapPoints groups of vertices: writes their displacement [n, 3].
constexpr size_t kMapPoints = 8;
size_t PatchMapItems(const format::PatchStageView& stage);
void MapPatches(const kernels::KernelTable& kernels, const format::PatchStageView& stage, const PatchMemory& memory,
                size_t begin, size_t count, float* displacement);

// u [K][3][R] of the newest tick.
inline const float* PatchDisplacement(const PatchMemory& memory) { return memory.cloth; }

// Whether the body was still for so long that no tick moves the cloth.
bool ArePatchesAtRest(const format::PatchStageView& stage, const PatchMemory& memory);

// The sizes that decide how the state is laid out, in one number; 0 without the stage.
uint32_t PatchShape(const format::PatchStageView& stage);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_PATCH_STAGE_H_
