#include "engine/format/verify_patches.h"

#include "engine/format/scan.h"
#include "kernels/matvec/matvec.h"

namespace dcloth::format {
namespace {

constexpr auto kByColumns = Checker::RowScales::kNone;

// The sizes that the table's own fields tell.
bool VerifySizes(const PatchStage& stage, const Path& path, Checker* check, PatchStageView* view) {
  view->point_count = stage.points();
  view->width = stage.width();
  view->neighbour_count = stage.neighbours();
  view->layer_count = stage.mix()->size();
  const Path width = {&path, "width"};
  if (!check->Count({&path, "patches"}, &stage, stage.patches(), 1, kMaxPatches) ||
      !check->Count({&path, "points"}, &stage, view->point_count, 1, kMaxPatchPoints) ||
      !check->Count(width, &stage, view->width, kPatchWidthStep, kMaxPatchWidth) ||
      !check->Count({&path, "neighbours"}, &stage, view->neighbour_count, 0, kMaxPatchNeighbours) ||
      !check->Count({&path, "mix.length"}, stage.mix(), view->layer_count, 1, kMaxMixes)) {
    return false;
  }
  if (view->width % kPatchWidthStep != 0) return check->FailCount(width, &stage, view->width, "", "a multiple of 8");
  view->patch_count = stage.patches();
  return true;
}

// Frames, points and what they see of the body.
bool VerifyPlaces(const PatchStage& stage, const Path& path, uint32_t joints, Checker* check, PatchStageView* view) {
  const uint32_t k = view->patch_count, points = k * view->point_count;
  const Path capsules = {&path, "capsule_joints"};
  return check->Indices({&path, "joints"}, stage.joints(), {k}, joints, &view->joints) &&
         check->Floats({&path, "axes"}, stage.axes(), {k, 9}, &view->axes) &&
         check->Floats({&path, "centres"}, stage.centres(), {k, 3}, &view->centres) &&
         check->Indices({&path, "point_joints"}, stage.point_joints(), {points, kPointInfluences}, joints,
                        &view->point_joints) &&
         check->Floats({&path, "point_parts"}, stage.point_parts(), {points, 4 * kPointInfluences},
                       &view->point_parts) &&
         check->Dimension(capsules, stage.capsule_joints(), 0, 1, kMaxCapsules, &view->capsule_count) &&
         check->Indices(capsules, stage.capsule_joints(), {view->capsule_count}, joints, &view->capsule_joints) &&
         check->Floats({&path, "capsules"}, stage.capsules(), {view->capsule_count, 8}, &view->capsules) &&
         check->Indices({&path, "limbs"}, stage.limbs(), {k, kLimbsAPatch * kCapsulesALimb}, view->capsule_count,
                        &view->limbs);
}

// What only some models have: a mixing layer without neighbours needs none, and patches may all be alike.
bool VerifyNeighbours(const PatchStage& stage, const Path& path, Checker* check, PatchStageView* view) {
  const Path near = {&path, "near"};
  const bool wanted = view->neighbour_count != 0;
  if (wanted != (stage.near() != nullptr)) {
    return wanted ? check->Fail(near, &stage, "no neighbours", "those that patch_stage.neighbours promises")
                  : check->Fail(near, stage.near(), "neighbours", "none where patch_stage.neighbours is 0");
  }
  return !wanted || check->Indices(near, stage.near(), {view->layer_count * view->neighbour_count, view->patch_count},
                                   view->patch_count, &view->near);
}

bool VerifyEmbedding(const PatchStage& stage, const Path& path, Checker* check, PatchStageView* view) {
  const Path embedding = {&path, "embedding"};
  return stage.embedding() == nullptr ||
         (check->Dimension(embedding, stage.embedding(), 1, 1, kMaxEmbedding, &view->embedding_size) &&
          check->Floats(embedding, stage.embedding(), {view->patch_count, view->embedding_size}, &view->embedding));
}

bool VerifyNetwork(const PatchStage& stage, const Path& path, Checker* check, PatchStageView* view) {
  const uint32_t width = view->width, inputs = PatchInputs(view->point_count, view->embedding_size);
  if (!check->Linear({&path, "enter"}, stage.enter(), inputs, width, &view->enter, kByColumns)) return false;
  for (uint32_t l = 0; l < view->layer_count; ++l) {
    if (!check->Linear({&path, "mix", l}, stage.mix()->Get(l), (1 + view->neighbour_count) * width, width,
                       &view->mix[l], kByColumns)) {
      return false;
    }
  }
  const Path hidden = {&path, "hidden_gates"};
  if (stage.hidden_gates()->bias() != nullptr) {
    return check->Fail({&hidden, "bias"}, stage.hidden_gates(), "a bias", "no bias: that of input_gates is for both");
  }
  return check->Linear({&path, "input_gates"}, stage.input_gates(), width, 3 * width, &view->input_gates, kByColumns) &&
         check->Linear(hidden, stage.hidden_gates(), width, 3 * width, &view->hidden_gates, kByColumns) &&
         check->Linear({&path, "out"}, stage.out(), width + inputs, 3 * view->point_count, &view->out, kByColumns);
}

// Cloth that grows by itself from tick to tick has no end.
bool VerifyKeep(const PatchStage& stage, const Path& path, Checker* check, PatchStageView* view) {
  if (!check->Floats(path, stage.keep(), {view->point_count}, &view->keep)) return false;
  for (uint32_t r = 0; r < view->point_count; ++r) {
    if (view->keep[r] >= 0 && view->keep[r] <= 1) continue;
    return check->FailElement(path, view->keep, r, sizeof(float), "a share below 0 or above 1", "0 to 1");
  }
  return true;
}

// Each point's vertices, at least one, and all of the garment's in the end.
bool VerifyGroups(const PatchStage& stage, const Path& parent, uint32_t n, Checker* check, PatchStageView* view) {
  const Path path = {&parent, "group_starts"};
  const uint32_t points = view->patch_count * view->point_count;
  if (!check->Permutation({&parent, "vertices"}, stage.vertices(), n, &view->vertices) ||
      !check->Words(path, stage.group_starts(), {points + 1}, &view->group_starts)) {
    return false;
  }
  const uint32_t* starts = view->group_starts;
  if (starts[0] != 0)
    return check->FailElement(path, starts, 0, sizeof(uint32_t), "a first group that does not start at 0", "0");
  const size_t bad = FindNotRising(starts, points);
  if (bad != points) {
    return check->FailElement(path, starts, bad + 1, sizeof(uint32_t),
                              "a group start that is not above the one before it",
                              "increasing group starts: each point has a vertex");
  }
  return check->Count({&path, nullptr, points}, starts + points, starts[points], n, n);
}

bool VerifyMap(const PatchStage& stage, const Path& path, Checker* check, PatchStageView* view) {
  const Path sources = {&path, "sources"};
  const uint32_t points = view->patch_count * view->point_count;
  if (!check->Dimension(sources, stage.sources(), 1, 2, kMaxSources, &view->source_count)) return false;
  if (view->source_count % 2 != 0)
    return check->FailCount(sources, stage.sources(), view->source_count, " points", "an even number of points");
  uint32_t columns = 0;
  for (uint32_t g = 0; g < points; ++g) {
    columns +=
        static_cast<uint32_t>(kernels::PaddedColumns(size_t{3} * (view->group_starts[g + 1] - view->group_starts[g])));
  }
  return check->Indices(sources, stage.sources(), {points, view->source_count}, points, &view->sources) &&
         check->Linear({&path, "map"}, stage.map(), 3 * view->source_count, columns, &view->map, kByColumns);
}

}  // namespace

bool VerifyPatchStage(const PatchStage& stage, Checker* check, ModelView* model) {
  const Path path = {nullptr, "patch_stage"};
  PatchStageView* view = &model->patch_stage;
  return VerifySizes(stage, path, check, view) && VerifyPlaces(stage, path, model->joint_count, check, view) &&
         VerifyNeighbours(stage, path, check, view) && VerifyEmbedding(stage, path, check, view) &&
         VerifyNetwork(stage, path, check, view) && VerifyKeep(stage, {&path, "keep"}, check, view) &&
         VerifyGroups(stage, path, model->vertex_count, check, view) && VerifyMap(stage, path, check, view);
}

}  // namespace dcloth::format
