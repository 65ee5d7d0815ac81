// The C ABI over the engine: checks arguments, translates, nothing else.
#include <cstddef>
#include <cstdint>
#include <new>

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"
#include "engine/format/limits.h"
#include "engine/format/verify.h"
#include "engine/format/view.h"
#include "engine/src/pose/host_rig.h"
#include "engine/src/cloth.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/time/idle.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/pose/host_rig.h"
#include "engine/src/base/lent_memory.h"
#include "engine/src/draw/output.h"
#include "engine/src/state/state.h"
#include "engine/src/network/schedule.h"
#include "engine/src/update.h"

namespace {

using dcloth::engine::ActiveSubnormals;
using dcloth::engine::CheckStorage;
using dcloth::engine::Cloth;
using dcloth::engine::FloatEnvironment;
using dcloth::format::Diagnostic;
using dcloth::format::kNoOffset;
using dcloth::format::ModelView;

constexpr size_t kModelStorage = (sizeof(ModelView) + DCLOTH_ALIGNMENT - 1) / DCLOTH_ALIGNMENT * DCLOTH_ALIGNMENT;

// The public types are never defined: their pointers are these types' pointers in disguise.
const ModelView& ViewOf(const dcloth_model* model) { return *reinterpret_cast<const ModelView*>(model); }
Cloth* ClothOf(dcloth_cloth* cloth) { return reinterpret_cast<Cloth*>(cloth); }

#define DCLOTH_TEXT_OF(x) #x
#define DCLOTH_TEXT(x) DCLOTH_TEXT_OF(x)
constexpr char kVersion[] =
    DCLOTH_TEXT(DCLOTH_VERSION_MAJOR) "." DCLOTH_TEXT(DCLOTH_VERSION_MINOR) "." DCLOTH_TEXT(DCLOTH_VERSION_PATCH);

bool FloatsAreAligned(const float* values) { return reinterpret_cast<uintptr_t>(values) % sizeof(float) == 0; }

bool PoseArgumentIsUsable(const dcloth_pose* pose) {
  return pose != nullptr && pose->struct_size >= sizeof(dcloth_pose) && pose->joint_matrices != nullptr &&
         FloatsAreAligned(pose->joint_matrices) && pose->column_major <= 1;
}

// A timer of 0.1 ends before `piece`.
bool TimerIsUsable(const dcloth_timer* timer) {
  return timer == nullptr || timer->struct_size >= offsetof(dcloth_timer, piece);
}

bool OutputArgumentIsUsable(const dcloth_output* output, const ModelView& model) {
  return output != nullptr && dcloth::engine::OutputIsUsable(*output, model.vertex_count);
}

bool StagesAreUsable(uint32_t stages, uint32_t held) {
  return (stages == DCLOTH_STAGES_STATIC || stages == DCLOTH_STAGES_SKELETON || stages == DCLOTH_STAGES_MESH) &&
         stages <= held;
}

bool FrameIsUsable(const dcloth_frame* frame, uint32_t held) {
  constexpr uint32_t kFlags = DCLOTH_FRAME_PIPELINED | DCLOTH_FRAME_JUMPED | DCLOTH_FRAME_HALF_RATE_MESH |
                              DCLOTH_FRAME_HOLD | DCLOTH_FRAME_FREEZE_IDLE;
  return frame != nullptr && frame->struct_size >= sizeof(dcloth_frame) && StagesAreUsable(frame->stages, held) &&
         frame->seconds >= 0.0f && frame->seconds <= dcloth::format::kLargestFloat && (frame->flags & ~kFlags) == 0;
}

}  // namespace

extern "C" {

const char* dcloth_version(void) { return kVersion; }

const char* dcloth_isa_name(void) { return dcloth::engine::ActiveKernels().name; }

dcloth_status dcloth_isa_select(const char* name) {
  return dcloth::engine::SelectKernels(name) ? DCLOTH_OK : DCLOTH_ERROR_ARGUMENT;
}

size_t dcloth_model_storage_size(void) { return kModelStorage; }

dcloth_status dcloth_model_open(const void* bytes, size_t size, void* storage, size_t storage_size,
                                dcloth_model** model, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (model == nullptr) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null `model`", "a place for the result", "");
    return diagnostic.status();
  }
  ModelView view;
  if (!CheckStorage(storage, storage_size, kModelStorage, &diagnostic) ||
      !dcloth::format::Verify(bytes, size, &view, &diagnostic)) {
    return diagnostic.status();
  }
  *model = reinterpret_cast<dcloth_model*>(new (storage) ModelView(view));
  return DCLOTH_OK;
}

dcloth_status dcloth_model_describe(const dcloth_model* model, dcloth_model_info* info) {
  const FloatEnvironment environment;
  if (model == nullptr || info == nullptr || info->struct_size < sizeof(dcloth_model_info))
    return DCLOTH_ERROR_ARGUMENT;
  const ModelView& view = ViewOf(model);
  info->joint_count = view.joint_count;
  info->vertex_count = view.vertex_count;
  info->triangle_count = view.triangle_count;
  info->stages = dcloth::engine::ModelStages(view);
  info->tick_seconds = 1.0f / view.tick_rate;
  info->format_major = view.format_major;
  info->format_minor = view.format_minor;
  info->name = view.name;
  info->precision = view.precision;
  info->triangles = view.faces;
  return DCLOTH_OK;
}

const char* dcloth_model_joint_name(const dcloth_model* model, uint32_t index) {
  return model == nullptr ? nullptr : dcloth::format::JointName(ViewOf(model), index);
}

uint32_t dcloth_model_body_vertex_count(const dcloth_model* model) {
  return model == nullptr ? 0 : ViewOf(model).body.vertex_count;
}

uint32_t dcloth_model_reads_wind(const dcloth_model* model) {
  return model != nullptr && ViewOf(model).features.root == dcloth::format::RootKind::kAir ? 1 : 0;
}

size_t dcloth_cloth_storage_size(const dcloth_model* model) {
  return model == nullptr ? 0 : dcloth::engine::PlaceCloth(ViewOf(model), nullptr, nullptr);
}

dcloth_status dcloth_cloth_create(const dcloth_model* model, void* storage, size_t storage_size, dcloth_cloth** cloth,
                                  dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (model == nullptr || cloth == nullptr) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null pointer", "a model and a place for the result",
                    "");
    return diagnostic.status();
  }
  if (!CheckStorage(storage, storage_size, dcloth_cloth_storage_size(model), &diagnostic)) return diagnostic.status();
  Cloth* placed = nullptr;
  dcloth::engine::PlaceCloth(ViewOf(model), storage, &placed);
  *cloth = reinterpret_cast<dcloth_cloth*>(placed);
  return DCLOTH_OK;
}

dcloth_status dcloth_cloth_bind_joints(dcloth_cloth* cloth, const char* const* names, uint32_t count,
                                       dcloth_error* error) {
  Diagnostic diagnostic(error);
  if (cloth == nullptr || names == nullptr || count == 0) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null pointer or no name",
                    "a cloth and the names of the host's joints", "");
    return diagnostic.status();
  }
  dcloth::engine::HostRig& rig = ClothOf(cloth)->rig;
  if (!dcloth::engine::MatchJoints(*ClothOf(cloth)->model, names, count, rig.joint_map, &diagnostic))
    return diagnostic.status();
  rig.host_joint_count = count;
  return DCLOTH_OK;
}

dcloth_status dcloth_cloth_set_space(dcloth_cloth* cloth, const dcloth_space* space, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (cloth == nullptr || space == nullptr || space->struct_size < sizeof(dcloth_space) ||
      !dcloth::engine::MakeSpace(*space, &ClothOf(cloth)->rig.space)) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a space that is none",
                    "struct_size set, left, up and forward along three different axes, metres_per_unit from 0.0001 to "
                    "1000, joint_frames 0 or 1",
                    "");
    return diagnostic.status();
  }
  return DCLOTH_OK;
}

dcloth_status dcloth_cloth_set_bind_pose(dcloth_cloth* cloth, const dcloth_pose* bind, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (cloth == nullptr || !PoseArgumentIsUsable(bind)) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null pointer", "a cloth and a pose", "");
    return diagnostic.status();
  }
  dcloth::engine::TakeBindPose(*ClothOf(cloth)->model, *bind, &ClothOf(cloth)->rig, &diagnostic);
  return diagnostic.status();
}

dcloth_status dcloth_cloth_set_wind(dcloth_cloth* cloth, const float* wind, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (cloth == nullptr || wind == nullptr || !FloatsAreAligned(wind)) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null or misaligned pointer",
                    "a cloth and the three floats of a wind", "");
    return diagnostic.status();
  }
  dcloth::engine::TakeWind(wind, ClothOf(cloth), &diagnostic);
  return diagnostic.status();
}

uint64_t dcloth_output_scratch_size(const dcloth_output* output) {
  return output == nullptr ? 0 : dcloth::engine::ScratchBytes(*output);
}

dcloth_status dcloth_cloth_reset(dcloth_cloth* cloth) {
  if (cloth == nullptr) return DCLOTH_ERROR_ARGUMENT;
  dcloth::engine::ResetCloth(ClothOf(cloth));
  return DCLOTH_OK;
}

size_t dcloth_cloth_state_size(const dcloth_cloth* cloth) {
  const FloatEnvironment environment;
  return cloth == nullptr ? 0 : dcloth::engine::StateSize(*reinterpret_cast<const Cloth*>(cloth));
}

dcloth_status dcloth_cloth_save(const dcloth_cloth* cloth, void* state, size_t size, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (cloth == nullptr || state == nullptr) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null pointer", "a cloth and memory for its state",
                    "");
    return diagnostic.status();
  }
  const Cloth& saved = *reinterpret_cast<const Cloth*>(cloth);
  const size_t needed = dcloth::engine::StateSize(saved);
  if (size < needed) {
    char allowed[48];
    dcloth::format::Text(allowed, sizeof(allowed)).Add("at least ").Add(uint64_t{needed});
    diagnostic.FailCount(DCLOTH_ERROR_MEMORY, kNoOffset, nullptr, size, " bytes for the state", allowed,
                         "lend what dcloth_cloth_state_size asks for");
    return diagnostic.status();
  }
  dcloth::engine::SaveState(saved, state, &diagnostic);
  return diagnostic.status();
}

dcloth_status dcloth_cloth_restore(dcloth_cloth* cloth, const void* state, size_t size, uint32_t flags,
                                   dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (cloth == nullptr || state == nullptr || (flags & ~uint32_t{DCLOTH_RESTORE_OTHER_MODEL}) != 0) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null pointer or an unknown flag",
                    "a cloth, the bytes of a state and DCLOTH_RESTORE_* or 0", "");
    return diagnostic.status();
  }
  dcloth::engine::RestoreState(state, size, flags != 0, ClothOf(cloth), &diagnostic);
  return diagnostic.status();
}

dcloth_status dcloth_cloth_update(dcloth_cloth* cloth, const dcloth_pose* pose, const dcloth_frame* frame,
                                  const dcloth_output* output, dcloth_timer* timer) {
  const FloatEnvironment environment;
  if (cloth == nullptr || !PoseArgumentIsUsable(pose) || !TimerIsUsable(timer)) return DCLOTH_ERROR_ARGUMENT;
  const ModelView& model = *ClothOf(cloth)->model;
  if (!FrameIsUsable(frame, dcloth::engine::ModelStages(model))) return DCLOTH_ERROR_ARGUMENT;
  if (output != nullptr && !OutputArgumentIsUsable(output, model)) return DCLOTH_ERROR_ARGUMENT;
  const FloatEnvironment arithmetic(ActiveSubnormals());
  return dcloth::engine::UpdateCloth(ClothOf(cloth), *pose, *frame, output, timer) ? DCLOTH_OK : DCLOTH_ERROR_POSE;
}

dcloth_status dcloth_cloth_describe(const dcloth_cloth* cloth, dcloth_cloth_info* info) {
  const FloatEnvironment environment;
  if (cloth == nullptr || info == nullptr || info->struct_size < sizeof(dcloth_cloth_info))
    return DCLOTH_ERROR_ARGUMENT;
  const Cloth& described = *reinterpret_cast<const Cloth*>(cloth);
  info->in_work = dcloth::engine::TickInWork(described) ? 1 : 0;
  info->lag_seconds = static_cast<float>(described.clock.lag() / static_cast<double>(described.model->tick_rate));
  info->tick_share = described.work_done;
  info->frozen = dcloth::engine::IsFrozen(described) ? 1 : 0;
  info->tick_waits = described.clock.tick_waits() && info->frozen == 0 ? 1 : 0;  // a frozen one wants none
  return DCLOTH_OK;
}

dcloth_status dcloth_cloth_tick(dcloth_cloth* cloth, const dcloth_pose* pose, uint32_t stages, dcloth_timer* timer) {
  const FloatEnvironment environment;
  if (cloth == nullptr || !PoseArgumentIsUsable(pose) || !TimerIsUsable(timer)) return DCLOTH_ERROR_ARGUMENT;
  const ModelView& model = *ClothOf(cloth)->model;
  if (!StagesAreUsable(stages, dcloth::engine::ModelStages(model))) return DCLOTH_ERROR_ARGUMENT;
  const FloatEnvironment arithmetic(ActiveSubnormals());
  return dcloth::engine::TickCloth(ClothOf(cloth), *pose, stages, timer) ? DCLOTH_OK : DCLOTH_ERROR_POSE;
}

dcloth_status dcloth_cloth_skin(dcloth_cloth* cloth, const dcloth_pose* pose, float blend, const dcloth_output* output,
                                dcloth_timer* timer) {
  const FloatEnvironment environment;
  if (cloth == nullptr || !PoseArgumentIsUsable(pose) || !TimerIsUsable(timer)) return DCLOTH_ERROR_ARGUMENT;
  const ModelView& model = *ClothOf(cloth)->model;
  const volatile float asked = blend;  // volatile: compared inside the environment, where a NaN does not trap
  if (!(asked >= 0.0f && asked <= 1.0f) || !OutputArgumentIsUsable(output, model)) return DCLOTH_ERROR_ARGUMENT;
  const FloatEnvironment arithmetic(ActiveSubnormals());
  return dcloth::engine::SkinCloth(ClothOf(cloth), *pose, blend, *output, timer) ? DCLOTH_OK : DCLOTH_ERROR_POSE;
}

}  // extern "C"
