#include "fit/make_fit.h"

#include <cstring>

#include "engine/format/checksum.h"
#include "engine/format/fit_file.h"
#include "engine/src/base/lent_memory.h"
#include "fit/body_fit.h"
#include "fit/rig_fit.h"

namespace dcloth::fit {
namespace {

using format::FitHead;
using format::FitLayout;
using format::ModelView;

constexpr float kFittedClearance = 0.005f;  // at least: posed, another body's skin is not where its surface is

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

// All that is known before the fit.
FitHead HeadOf(const ModelView& model, const dcloth_character& character) {
  FitHead head = {};
  std::memcpy(head.magic, format::kFitMagic, sizeof(head.magic));
  head.version = format::kFitVersion;
  head.joint_count = model.joint_count;
  head.host_joint_count = character.joint_count;
  if (character.body_vertex_count != 0) head.vertex_count = model.vertex_count;
  if (character.body_vertex_count != 0 && model.body.vertex_count != 0) {
    head.body_vertex_count = model.body.vertex_count;
    head.influences = model.body.influences;
    const float clearance = model.body.clearance, reach = model.body.reach;
    head.clearance = clearance < kFittedClearance ? kFittedClearance : clearance;
    head.reach = reach < head.clearance ? head.clearance : reach;
  }
  head.size = format::LayoutOf(head).size;
  return head;
}

void WriteArrays(const FitHead& head, const FitLayout& at, const BodyFitMemory& made, uint8_t* bytes) {
  const size_t n = head.vertex_count, b = head.body_vertex_count, held = b * head.influences;
  std::memcpy(bytes + at.positions, made.template_positions, 3 * n * sizeof(float));
  std::memcpy(bytes + at.body_positions, made.body_positions, 3 * b * sizeof(float));
  std::memcpy(bytes + at.body_weights, made.body_weights, held * sizeof(float));
  std::memcpy(bytes + at.body_joints, made.body_joints, held);
}

}  // namespace

size_t FitStorageSize(const ModelView& model, const dcloth_character& character) {
  Arena arena(nullptr);
  arena.Take<uint8_t>(HeadOf(model, character).size);
  if (character.body_vertex_count != 0) PlaceBodyFit(model, character.joint_count, &arena);
  return arena.size();
}

bool MakeFit(const ModelView& model, const Space& space, const dcloth_character& character, void* storage,
             size_t storage_size, uint64_t* work_left, dcloth_fit* report, format::Diagnostic* diagnostic) {
  RigFit fit;
  const bool skin = character.body_vertex_count != 0;
  if (!engine::CheckStorage(storage, storage_size, FitStorageSize(model, character), diagnostic) ||
      (skin && !CheckBody(character, diagnostic)) || !MeasureRig(model, character, space, &fit, report, diagnostic)) {
    return false;
  }
  FitHead head = HeadOf(model, character);
  Arena arena(storage);
  uint8_t* const bytes = arena.Take<uint8_t>(head.size);
  BodyFitMemory memory = {};
  head.scale = fit.bone_scale;
  if (skin) {
    memory = PlaceBodyFit(model, character.joint_count, &arena);
    memory.work_left = work_left;
    if (!FitBody(model, character, fit, memory, &head.scale, report)) return RefuseWork(character, diagnostic);
  }
  const FitLayout at = format::LayoutOf(head);
  std::memset(bytes, 0, head.size);
  if (skin) WriteArrays(head, at, memory, bytes);
  WriteJoints(model, character, fit, head.scale, reinterpret_cast<format::FitJoint*>(bytes + at.joints));
  head.figure = format::FigureOf(model);
  const size_t named = std::strlen(model.name);
  std::memcpy(head.garment, model.name, named < sizeof(head.garment) ? named : sizeof(head.garment));
  std::memcpy(bytes, &head, sizeof(head));
  head.checksum = format::Checksum(bytes + format::kFitSummedFrom, head.size - format::kFitSummedFrom);
  std::memcpy(bytes, &head, sizeof(head));
  report->file_bytes = head.size;
  return true;
}

}  // namespace dcloth::fit
