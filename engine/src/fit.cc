#include "engine/src/fit.h"

#include "engine/src/base/arithmetic.h"
#include "engine/src/base/lent_memory.h"
#include "engine/src/body/body_fit.h"
#include "engine/src/pose/rig_fit.h"

namespace dcloth::engine {

namespace {

bool RefuseWork(const dcloth_character& character, format::Diagnostic* diagnostic) {
  const bool triangles = character.body_triangles != nullptr;
  const format::Path parent = {nullptr, "character"};
  const format::Path path = {&parent, triangles ? "body_triangle_count" : "body_vertex_count"};
  return diagnostic->FailCount(
      DCLOTH_ERROR_ARGUMENT, format::kNoOffset, &path,
      triangles ? character.body_triangle_count : character.body_vertex_count, ", which take more work than a fit may",
      "what 100,000 triangles of a person's skin take",
      "reduce the mesh, leave out hair, props and hidden layers; check the unit of dcloth_space");
}

}  // namespace

size_t FitStorageSize(const format::ModelView& model, const dcloth_character& character) {
  if (character.body_vertex_count == 0) return 0;
  Arena arena(nullptr);
  PlaceBodyFit(model, character.joint_count, &arena);
  return arena.size();
}

bool FitCloth(const dcloth_character& character, void* storage, size_t storage_size, uint64_t* work_left, Cloth* cloth,
              dcloth_fit* report, format::Diagnostic* diagnostic) {
  const format::ModelView& model = *cloth->trained;
  const size_t needed = FitStorageSize(model, character);
  RigFit fit;
  if ((needed != 0 && !CheckStorage(storage, storage_size, needed, diagnostic)) ||
      (needed != 0 && !CheckBody(character, diagnostic)) ||
      !MeasureRig(model, character, cloth->fitted ? cloth->told_space : cloth->rig.space, &fit, report, diagnostic)) {
    return false;
  }
  double scale = fit.bone_scale;
  const format::ModelView* view = &model;
  if (needed != 0) {
    Arena arena(storage);
    BodyFitMemory memory = PlaceBodyFit(model, character.joint_count, &arena);
    memory.work_left = work_left;
    if (!FitBody(ActiveKernels(), model, character, fit, memory, &scale, report))
      return RefuseWork(character, diagnostic);
    view = memory.view;
  }
  cloth->told_space = fit.space;
  cloth->model = view;
  PrepareContact(ActiveKernels(), *view, cloth->contact);
  cloth->fitted = true;
  TakeFit(model, character, fit, scale, &cloth->rig);
  return true;
}

}  // namespace dcloth::engine
