#include "engine/src/skinning.h"

#include <cstddef>
#include <cstdint>

namespace dcloth::engine {
namespace {

// A_j = [R_j | p_j - R_j (J_j + D_j)]. With p_j = G_j B_j^-1 J_j = R_j J_j + t_j the pivot J_j cancels: the translation
// is t_j - R_j D_j, t_j that of G_j B_j^-1.
Affine BoneMatrix(const Affine& bound, const double increment[3]) {
  Affine matrix = bound;
  for (auto& row : matrix.m) row[3] -= row[0] * increment[0] + row[1] * increment[1] + row[2] * increment[2];
  return matrix;
}

}  // namespace

void SkinRelative(const kernels::KernelTable& kernels, const format::ModelView& model, const BoundPose& bound,
                  const TickPair& ticks, float* matrices, const dcloth_output& output) {
  const format::StaticStageView& stage = model.static_stage;
  const double blend = static_cast<double>(ticks.blend);
  for (size_t bone = 0; bone < stage.bone_count; ++bone) {
    double increment[3];
    for (size_t c = 0; c < 3; ++c) {
      const double from = static_cast<double>(ticks.increments[0][3 * bone + c]);
      increment[c] = from + blend * (static_cast<double>(ticks.increments[1][3 * bone + c]) - from);
    }
    StoreFloats(BoneMatrix(bound.joints[stage.bones[bone]], increment), matrices + 12 * bone);
  }
  kernels::SkinningJob job = {};
  job.matrices = matrices;
  job.positions = model.template_positions;
  job.delta0 = ticks.displacement[0];
  job.delta1 = ticks.displacement[1];
  job.bones = stage.influence_bones;
  job.weights = stage.influence_weights;
  job.out = output.positions;
  job.out_stride_bytes = output.position_stride_bytes;
  job.vertices = model.vertex_count;
  job.influences = stage.influences;
  job.blend = ticks.blend;
  kernels.skinning(job);
}

void MoveToWorld(const double origin[3], const dcloth_output& output) {
  // The host's matrices are floats, and so is the hips' position: the conversion is exact.
  const float x = static_cast<float>(origin[0]), y = static_cast<float>(origin[1]), z = static_cast<float>(origin[2]);
  uint8_t* vertex = reinterpret_cast<uint8_t*>(output.positions);
  for (uint32_t i = 0; i < output.vertex_count; ++i, vertex += output.position_stride_bytes) {
    float* position = reinterpret_cast<float*>(vertex);
    position[0] += x;
    position[1] += y;
    position[2] += z;
  }
}

}  // namespace dcloth::engine
