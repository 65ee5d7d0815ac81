#include "engine/src/cloth.h"

#include <cmath>
#include <cstring>
#include <new>

#include "engine/src/base/arithmetic.h"
#include "engine/src/network/displacement.h"
#include "engine/src/network/pose_stages.h"
#include "engine/src/time/idle.h"

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

}  // namespace

uint32_t SlotBefore(const Cloth& cloth, uint32_t back) {
  const uint32_t oldest = cloth.tick_count > 1 ? cloth.tick_count - 1 : 0;
  return (cloth.newest + kTickSlots - (back < oldest ? back : oldest)) % kTickSlots;
}

size_t PlaceCloth(const ModelView& model, void* storage, Cloth** out) {
  if (storage != nullptr) std::memset(storage, 0, PlaceCloth(model, nullptr, nullptr));
  Arena arena(storage);
  auto* cloth = arena.Take<Cloth>(1);
  Cloth placed = {};
  placed.model = placed.trained = &model;
  placed.fitted_model = arena.Take<ModelView>(1);
  placed.rig = {Space(), model.joint_count, arena.Take<uint32_t>(model.joint_count),
                arena.Take<Affine>(model.joint_count), false};
  placed.skin_joints = arena.Take<Affine>(model.joint_count);
  placed.pose_older = arena.Take<Affine>(model.joint_count);
  placed.pose_before = arena.Take<Affine>(model.joint_count);
  placed.pose_now = arena.Take<Affine>(model.joint_count);
  placed.idle_pose = arena.Take<Affine>(model.joint_count);
  placed.idle_start = arena.Take<float>(IdleStartFloats(model));
  placed.matrices = arena.Take<float>(size_t{12} * model.static_stage.bone_count);
  placed.features = arena.Take<float>(model.features.length);
  placed.hidden = arena.Take<float>(kernels::PaddedColumns(model.static_stage.hidden.columns));
  placed.quantized = arena.Take<int16_t>(WidestQuantized(model));
  placed.skeleton = PlaceSkeletonScratch(model.skeleton_stage, &arena);
  placed.mesh = PlaceMeshMemory(model, &arena);
  placed.patches = PlacePatchMemory(model, &arena);
  placed.contact = PlaceContactMemory(model, &arena);
  placed.coefficients = arena.Take<float>(CoefficientFloats(model));
  for (float*& increments : placed.increments) increments = arena.Take<float>(IncrementFloats(model.static_stage));
  for (float*& displacement : placed.displacement) {
    const size_t floats = DisplacementFloats(model);
    displacement = floats != 0 ? arena.Take<float>(floats) : nullptr;
  }
  if (storage != nullptr) {
    *out = new (cloth) Cloth(placed);
    for (uint32_t j = 0; j < model.joint_count; ++j) placed.rig.joint_map[j] = j;
    ResetCloth(*out);
  }
  return arena.size();
}

void ResetCloth(Cloth* cloth) {
  const ModelView& model = *cloth->model;
  cloth->root = RootMotion();
  std::memset(cloth->features, 0, model.features.length * sizeof(float));
  cloth->clock = FrameClock();
  cloth->work = {TickPart::kDone, 0, {}};
  if (model.skeleton_stage.units != 0) std::memset(cloth->coefficients, 0, model.skeleton_stage.units * sizeof(float));
  ClearMeshState(model, cloth->mesh);
  ClearPatchState(model.patch_stage, cloth->patches);
  std::memset(cloth->idle_pose, 0, model.joint_count * sizeof(Affine));
  for (float* increments : cloth->increments) {
    std::memset(increments, 0, IncrementFloats(model.static_stage) * sizeof(float));
  }
  for (float* displacement : cloth->displacement) {
    if (displacement != nullptr) std::memset(displacement, 0, DisplacementFloats(model) * sizeof(float));
  }
  cloth->newest = 0;
  cloth->tick_count = 0;
  cloth->stages = DCLOTH_STAGES_MESH;
  cloth->idle_ticks = 0;
  cloth->work_done = 0;
  cloth->older_step = 0;
  cloth->contact_clock = {};
}

bool TakeWind(const float* wind, Cloth* cloth, format::Diagnostic* diagnostic) {
  const float taken[3] = {wind[0], wind[1], wind[2]};
  double in_metres[3];
  VectorFromHost(cloth->rig.space, taken, in_metres);
  const double speed =
      std::sqrt(in_metres[0] * in_metres[0] + in_metres[1] * in_metres[1] + in_metres[2] * in_metres[2]);
  if (!(speed <= kFastestWind)) {
    char found[48];
    format::Text(found, sizeof(found)).Add("a wind of ").AddNumber(speed).Add(" m/s");
    return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, format::kNoOffset, nullptr, found, "finite numbers, at most 100 m/s",
                            "wind is in host units per second: call dcloth_cloth_set_space first");
  }
  std::memcpy(cloth->wind, taken, sizeof(taken));
  return true;
}

uint32_t ModelStages(const ModelView& model) {
  if (model.mesh_stage.layer_count != 0 || model.patch_stage.patch_count != 0) return DCLOTH_STAGES_MESH;
  return model.skeleton_stage.units != 0 ? DCLOTH_STAGES_SKELETON : DCLOTH_STAGES_STATIC;
}

}  // namespace dcloth::engine
