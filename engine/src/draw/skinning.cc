#include "engine/src/draw/skinning.h"

#include <cstddef>

namespace dcloth::engine {
namespace {

// A_j = [R_j | p_j - R_j (J_j + D_j)]. With p_j = G_j B_j^-1 J_j = R_j J_j + t_j the pivot J_j cancels: the translation
// is t_j - R_j D_j, t_j that of G_j B_j^-1.
Affine BoneMatrix(const Affine& skin, const double increment[3]) {
  Affine matrix = skin;
  for (auto& row : matrix.m) row[3] -= row[0] * increment[0] + row[1] * increment[1] + row[2] * increment[2];
  return matrix;
}

}  // namespace

void SkinRelative(const kernels::KernelTable& kernels, const format::ModelView& model, const Space& space,
                  const SkinPose& skin, const TickPair& ticks, float* matrices, const DrawnMesh& mesh,
                  const Surface& surface) {
  const format::StaticStageView& stage = model.static_stage;
  const double blend = static_cast<double>(ticks.blend);
  for (size_t bone = 0; bone < stage.bone_count; ++bone) {
    double increment[3];
    for (size_t c = 0; c < 3; ++c) {
      const double from = static_cast<double>(ticks.increments[0][3 * bone + c]);
      increment[c] = from + blend * (static_cast<double>(ticks.increments[1][3 * bone + c]) - from);
    }
    const Affine matrix = BoneMatrix(skin.joints[stage.bones[bone]], increment);
    StoreFloats(ToHost(space, matrix), matrices + 12 * bone);
  }
  kernels::SkinningJob job = {};
  job.matrices = matrices;
  job.positions = model.template_positions;
  job.delta0 = ticks.displacement[0];
  job.delta1 = ticks.displacement[1];
  job.bones = stage.influence_bones;
  job.weights = stage.influence_weights;
  job.out = surface.positions;
  job.out_stride_bytes = surface.position_stride_bytes;
  job.chosen = mesh.vertices;
  job.vertices = mesh.vertex_count;
  job.influences = stage.influences;
  job.blend = ticks.blend;
  // Normals begin with clearing their sums: 8 us less for the skirt with emptied caches, 1 more with warm ones.
  job.ahead = surface.normal_stride_bytes == 3 * sizeof(float) ? surface.normals : nullptr;
  kernels.skinning(job);
}

}  // namespace dcloth::engine
