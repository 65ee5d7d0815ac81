#include "engine/src/cloth.h"

#include <cstring>
#include <new>

#include "engine/src/coefficients.h"
#include "engine/src/displacement.h"
#include "engine/src/isa.h"
#include "engine/src/normals.h"
#include "engine/src/skinning.h"
#include "engine/src/static_stage.h"
#include "engine/src/stopwatch.h"

namespace dcloth::engine {
namespace {

using format::ModelView;

size_t WidestQuantized(const ModelView& model) {
  const format::LinearView* const layers[] = {&model.static_stage.hidden,  &model.static_stage.increments,
                                              &model.skeleton_stage.input, &model.skeleton_stage.hidden,
                                              &model.mesh_stage.hidden,    &model.mesh_stage.coefficients,
                                              &model.displacement.head,    &model.displacement.basis};
  size_t widest = 0;
  for (const format::LinearView* layer : layers) {
    const size_t elements = QuantizedElements(*layer);
    if (elements > widest) widest = elements;
  }
  return widest;
}

void ClearSkeletonState(Cloth* cloth) {
  const size_t units = cloth->model->skeleton_stage.units;
  if (units != 0) std::memset(cloth->coefficients, 0, units * sizeof(float));
}

// A stage that rested starts from zero: what it remembers belongs to a motion long past.
void WakeStages(Cloth* cloth, uint32_t stages) {
  const uint32_t woken = stages & ~cloth->stages;
  if ((woken & (DCLOTH_STAGES_SKELETON & ~DCLOTH_STAGES_STATIC)) != 0) ClearSkeletonState(cloth);
  if ((woken & (DCLOTH_STAGES_MESH & ~DCLOTH_STAGES_SKELETON)) != 0) ClearMeshState(*cloth->model, cloth->mesh);
  cloth->stages = stages;
}

}  // namespace

size_t PlaceCloth(const ModelView& model, void* storage, Cloth** out) {
  Arena arena(storage);
  auto* cloth = arena.Take<Cloth>(1);
  Cloth placed = {};
  placed.model = &model;
  placed.joints = arena.Take<Affine>(model.joint_count);
  placed.matrices = arena.Take<float>(size_t{12} * model.static_stage.bone_count);
  placed.features = arena.Take<float>(model.features.length);
  placed.hidden = arena.Take<float>(kernels::PaddedColumns(model.static_stage.hidden.columns));
  placed.quantized = arena.Take<int16_t>(WidestQuantized(model));
  placed.skeleton = PlaceSkeletonScratch(model.skeleton_stage, &arena);
  placed.mesh = PlaceMeshMemory(model, &arena);
  placed.coefficients = arena.Take<float>(CoefficientFloats(model));
  for (float*& increments : placed.increments) increments = arena.Take<float>(IncrementFloats(model.static_stage));
  for (float*& displacement : placed.displacement) {
    const size_t floats = DisplacementFloats(model);
    displacement = floats != 0 ? arena.Take<float>(floats) : nullptr;
  }
  if (storage != nullptr) {
    std::memset(storage, 0, arena.size());
    *out = new (cloth) Cloth(placed);
    ResetCloth(*out);
  }
  return arena.size();
}

void ResetCloth(Cloth* cloth) {
  const ModelView& model = *cloth->model;
  cloth->root = RootMotion();
  ClearSkeletonState(cloth);
  ClearMeshState(model, cloth->mesh);
  for (float* increments : cloth->increments) {
    std::memset(increments, 0, IncrementFloats(model.static_stage) * sizeof(float));
  }
  for (float* displacement : cloth->displacement) {
    if (displacement != nullptr) std::memset(displacement, 0, DisplacementFloats(model) * sizeof(float));
  }
  cloth->current = 0;
  cloth->tick_count = 0;
  cloth->stages = DCLOTH_STAGES_MESH;
}

uint32_t ModelStages(const ModelView& model) {
  if (model.mesh_stage.layer_count != 0) return DCLOTH_STAGES_MESH;
  return model.skeleton_stage.units != 0 ? DCLOTH_STAGES_SKELETON : DCLOTH_STAGES_STATIC;
}

bool TickCloth(Cloth* cloth, const dcloth_pose& pose, uint32_t stages, dcloth_timer* timer) {
  Stopwatch watch(timer);
  const ModelView& model = *cloth->model;
  if (!PoseIsUsable(model, pose)) return false;
  const kernels::KernelTable& kernels = ActiveKernels();
  BoundPose bound = {cloth->joints, {}};
  BindPose(model, pose, &bound);
  UpdateFeatures(model, bound, &cloth->root, cloth->features);
  WakeStages(cloth, stages);
  if (cloth->tick_count < 2) ++cloth->tick_count;
  cloth->current ^= 1;
  watch.Lap(DCLOTH_STEP_POSE);

  RunStaticStage(kernels, model.static_stage, cloth->features, cloth->hidden, cloth->quantized,
                 cloth->increments[cloth->current]);
  watch.Lap(DCLOTH_STEP_STATIC);
  if (stages >= DCLOTH_STAGES_SKELETON) {
    RunSkeletonStage(kernels, model.skeleton_stage, cloth->features, cloth->skeleton, cloth->quantized,
                     cloth->coefficients);
    watch.Lap(DCLOTH_STEP_SKELETON);
  }
  if (stages >= DCLOTH_STAGES_MESH) {
    RunMeshStage(kernels, model, bound, cloth->root.heading, cloth->mesh, cloth->quantized,
                 cloth->coefficients + MeshCoefficientsAt(model));
    watch.Lap(DCLOTH_STEP_MESH);
  }
  RunDisplacement(kernels, model, stages, cloth->coefficients, cloth->quantized, cloth->displacement[cloth->current]);
  watch.Lap(DCLOTH_STEP_DISPLACEMENT);
  return true;
}

bool SkinCloth(Cloth* cloth, const dcloth_pose& pose, float blend, const dcloth_output& output, dcloth_timer* timer) {
  Stopwatch watch(timer);
  const ModelView& model = *cloth->model;
  if (!PoseIsUsable(model, pose)) return false;
  const kernels::KernelTable& kernels = ActiveKernels();
  BoundPose bound = {cloth->joints, {}};
  BindPose(model, pose, &bound);
  watch.Lap(DCLOTH_STEP_POSE);

  const uint32_t to = cloth->current;
  const uint32_t from = cloth->tick_count < 2 ? to : to ^ 1;  // the first tick has nothing before it
  const TickPair ticks = {
      {cloth->increments[from], cloth->increments[to]}, {cloth->displacement[from], cloth->displacement[to]}, blend};
  SkinRelative(kernels, model, bound, ticks, cloth->matrices, output);
  watch.Lap(DCLOTH_STEP_SKINNING);
  RunNormals(kernels, model, output);
  watch.Lap(DCLOTH_STEP_NORMALS);
  MoveToWorld(bound.origin, output);
  watch.Lap(DCLOTH_STEP_SKINNING);
  return true;
}

}  // namespace dcloth::engine
