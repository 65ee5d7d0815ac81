// The C ABI over the engine: checks arguments, translates, nothing else.
#include <cstddef>
#include <cstdint>
#include <new>

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"
#include "engine/format/limits.h"
#include "engine/format/verify.h"
#include "engine/format/view.h"
#include "engine/src/base/arithmetic.h"
#include "engine/src/base/host_struct.h"
#include "engine/src/base/lent_memory.h"
#include "engine/src/cloth.h"
#include "engine/src/draw/output.h"
#include "engine/src/fit.h"
#include "engine/src/network/schedule.h"
#include "engine/src/pose/host_rig.h"
#include "engine/src/state/state.h"
#include "engine/src/time/idle.h"
#include "engine/src/update.h"

namespace {

using dcloth::engine::ActiveSubnormals;
using dcloth::engine::CheckStorage;
using dcloth::engine::Cloth;
using dcloth::engine::FloatEnvironment;
using dcloth::format::Diagnostic;
using dcloth::format::kNoOffset;
using dcloth::format::ModelView;
using dcloth::format::Path;

constexpr size_t kModelStorage = (sizeof(ModelView) + DCLOTH_ALIGNMENT - 1) / DCLOTH_ALIGNMENT * DCLOTH_ALIGNMENT;

// The public types are never defined: their pointers are these types' pointers in disguise.
const ModelView& ViewOf(const dcloth_model* model) { return *reinterpret_cast<const ModelView*>(model); }
Cloth* ClothOf(dcloth_cloth* cloth) { return reinterpret_cast<Cloth*>(cloth); }

#define DCLOTH_TEXT_OF(x) #x
#define DCLOTH_TEXT(x) DCLOTH_TEXT_OF(x)
constexpr char kVersion[] =
    DCLOTH_TEXT(DCLOTH_VERSION_MAJOR) "." DCLOTH_TEXT(DCLOTH_VERSION_MINOR) "." DCLOTH_TEXT(DCLOTH_VERSION_PATCH);

static_assert(DCLOTH_VERSION_NUMBER ==
                  1000000 * DCLOTH_VERSION_MAJOR + 1000 * DCLOTH_VERSION_MINOR + DCLOTH_VERSION_PATCH,
              "one version");
// Where a struct has an array, the library counts on these many.
static_assert(DCLOTH_TIMER_STEPS == DCLOTH_STEP_COUNT, "a step more is a field more");

bool FloatsAreAligned(const float* values) { return reinterpret_cast<uintptr_t>(values) % sizeof(float) == 0; }

constexpr char kNoStruct[] = "a null pointer, or a struct_size smaller than in 0.1.0";

bool Refuse(const char* argument, const char* field, const char* found, const char* allowed, Diagnostic* diagnostic) {
  const Path parent = {nullptr, argument}, path = {&parent, field};
  return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, field == nullptr ? &parent : &path, found, allowed, "");
}

// Reads a struct of the host's, which may be another version's.
template <typename T>
bool Read(const T* given, const char* argument, T* read, Diagnostic* diagnostic) {
  if (!dcloth::engine::IsWhole(given))
    return Refuse(argument, nullptr, kNoStruct, "a struct whose struct_size is its sizeof", diagnostic);
  *read = dcloth::engine::ReadStruct(*given);
  return true;
}

bool ReadPose(const dcloth_pose* given, dcloth_pose* pose, Diagnostic* diagnostic) {
  if (!Read(given, "pose", pose, diagnostic)) return false;
  if (pose->joint_matrices == nullptr || !FloatsAreAligned(pose->joint_matrices))
    return Refuse("pose", "joint_matrices", "a null or misaligned pointer", "a pointer to floats, aligned to 4 bytes",
                  diagnostic);
  if (pose->column_major > 1) return Refuse("pose", "column_major", "a number above 1", "0 or 1", diagnostic);
  return true;
}

bool CheckTimer(const dcloth_timer* timer, Diagnostic* diagnostic) {
  return timer == nullptr || dcloth::engine::IsWhole(timer) ||
         Refuse("timer", nullptr, kNoStruct, "null, or a struct whose struct_size is its sizeof", diagnostic);
}

bool ReadOutput(const dcloth_output* given, const ModelView& model, dcloth_output* output, Diagnostic* diagnostic) {
  return Read(given, "output", output, diagnostic) && dcloth::engine::CheckOutput(*output, model, diagnostic);
}

// At most what the model holds: a host need not know.
bool TakeStages(const ModelView& model, const char* argument, uint32_t* stages, Diagnostic* diagnostic) {
  if (*stages != DCLOTH_STAGES_STATIC && *stages != DCLOTH_STAGES_SKELETON && *stages != DCLOTH_STAGES_MESH)
    return Refuse(argument, "stages", "an unknown number", "DCLOTH_STAGES_*", diagnostic);
  const uint32_t held = dcloth::engine::ModelStages(model);
  if (*stages > held) *stages = held;
  return true;
}

bool ReadFrame(const dcloth_frame& given, const ModelView& model, dcloth_frame* frame, Diagnostic* diagnostic) {
  constexpr uint32_t kUnused = 4;  // half rate of the mesh stage in 0.1
  constexpr uint32_t kFlags =
      DCLOTH_FRAME_PIPELINED | DCLOTH_FRAME_JUMPED | kUnused | DCLOTH_FRAME_HOLD | DCLOTH_FRAME_FREEZE_IDLE;
  *frame = given;
  if (!TakeStages(model, "frame", &frame->stages, diagnostic)) return false;
  if (!(frame->seconds >= 0.0f && frame->seconds <= dcloth::format::kLargestFloat)) {
    const Path parent = {nullptr, "frame"}, path = {&parent, "seconds"};
    char found[32];
    dcloth::format::Text(found, sizeof(found)).AddNumber(static_cast<double>(frame->seconds));
    return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, &path, found, "finite numbers of 0 or more", "");
  }
  if ((frame->flags & ~kFlags) != 0)
    return Refuse("frame", "flags", "an unknown flag", "DCLOTH_FRAME_* or 0", diagnostic);
  return true;
}

// A fit has decided what the call would change.
bool RefuseFitted(Diagnostic* diagnostic) {
  const Path path = {nullptr, "cloth"};
  return diagnostic->Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, &path, "a cloth with a fit", "one without",
                          "make this call before dcloth_cloth_set_fit or dcloth_cloth_fit");
}

}  // namespace

extern "C" {

const char* dcloth_version(void) { return kVersion; }

uint32_t dcloth_version_number(void) { return DCLOTH_VERSION_NUMBER; }

const char* dcloth_status_name(dcloth_status status) {
  static constexpr const char* kNames[] = {"OK",      "ARGUMENT",  "ALIGNMENT", "MEMORY", "FORMAT",
                                           "VERSION", "SEMANTICS", "POSE",      "JOINTS", "MODEL"};
  constexpr auto kCount = static_cast<dcloth_status>(sizeof(kNames) / sizeof(kNames[0]));
  return status >= 0 && status < kCount ? kNames[status] : "UNKNOWN";
}

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
  if (!CheckStorage(storage, storage_size, kModelStorage, &diagnostic)) return diagnostic.status();
  auto* view = new (storage) ModelView;  // not on the stack, of which a fibre has little
  if (!dcloth::format::Verify(bytes, size, view, &diagnostic)) return diagnostic.status();
  *model = reinterpret_cast<dcloth_model*>(view);
  return DCLOTH_OK;
}

dcloth_status dcloth_model_describe(const dcloth_model* model, dcloth_model_info* info) {
  const FloatEnvironment environment;
  if (model == nullptr || !dcloth::engine::IsWhole(info)) return DCLOTH_ERROR_ARGUMENT;
  const ModelView& view = ViewOf(model);
  dcloth_model_info filled = {};
  filled.joint_count = view.joint_count;
  filled.vertex_count = view.vertex_count;
  filled.triangle_count = view.triangle_count;
  filled.stages = dcloth::engine::ModelStages(view);
  filled.tick_seconds = 1.0f / view.tick_rate;
  filled.format_major = view.format_major;
  filled.format_minor = view.format_minor;
  filled.name = view.name;
  filled.precision = view.precision;
  filled.triangles = view.faces;
  filled.positions = view.template_positions;
  filled.coarse_vertices = view.coarse.vertices;
  filled.coarse_triangles = view.coarse.faces;
  filled.coarse_vertex_count = view.coarse.vertex_count;
  filled.coarse_triangle_count = view.coarse.triangle_count;
  filled.texture_coordinates = view.texture.coordinates;
  filled.textured_triangles = view.texture.faces;
  filled.seam_vertices = view.texture.seam_vertices;
  filled.textured_vertex_count = view.texture.vertex_count;
  filled.seam_vertex_count = view.texture.vertex_count == 0 ? 0 : view.texture.vertex_count - view.vertex_count;
  dcloth::engine::WriteStruct(filled, info);
  return DCLOTH_OK;
}

const char* dcloth_model_joint_name(const dcloth_model* model, uint32_t index) {
  return model == nullptr ? nullptr : dcloth::format::JointName(ViewOf(model), index);
}

int32_t dcloth_model_joint_parent(const dcloth_model* model, uint32_t index) {
  if (model == nullptr || index >= ViewOf(model).joint_count || ViewOf(model).parents == nullptr)
    return DCLOTH_JOINT_UNKNOWN;
  const uint16_t parent = ViewOf(model).parents[index];
  return parent == dcloth::format::kNoParent ? DCLOTH_JOINT_TOP : int32_t{parent};
}

dcloth_status dcloth_model_joint_bind(const dcloth_model* model, uint32_t index, float* matrix) {
  const FloatEnvironment environment;
  if (model == nullptr || matrix == nullptr || !FloatsAreAligned(matrix) || index >= ViewOf(model).joint_count)
    return DCLOTH_ERROR_ARGUMENT;
  dcloth::engine::Affine bind;
  if (!dcloth::engine::BindMatrix(ViewOf(model), index, &bind)) return DCLOTH_ERROR_SEMANTICS;
  for (int i = 0; i < 12; ++i) matrix[i] = static_cast<float>(bind.m[i / 4][i % 4]);
  for (int i = 12; i < 16; ++i) matrix[i] = i == 15 ? 1.0f : 0.0f;
  return DCLOTH_OK;
}

uint32_t dcloth_model_body_vertex_count(const dcloth_model* model) {
  return model == nullptr ? 0 : ViewOf(model).body.vertex_count;
}

dcloth_status dcloth_model_output(const dcloth_model* model, dcloth_output* output) {
  if (model == nullptr || !dcloth::engine::IsWhole(output)) return DCLOTH_ERROR_ARGUMENT;
  dcloth_output filled = {};
  filled.vertex_count = ViewOf(model).vertex_count;
  filled.position_stride_bytes = filled.normal_stride_bytes = 3 * sizeof(float);
  filled.tangent_stride_bytes = 4 * sizeof(float);
  filled.texture_stride_bytes = 2 * sizeof(float);
  filled.flags = ViewOf(model).body.vertex_count != 0 ? uint32_t{DCLOTH_OUTPUT_OUTSIDE_BODY} : 0;
  dcloth::engine::WriteStruct(filled, output);
  return DCLOTH_OK;
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
  dcloth::engine::PrepareContact(dcloth::engine::ActiveKernels(), ViewOf(model), placed->contact);
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
  dcloth::engine::BindJoints(names, count, ClothOf(cloth), &diagnostic);
  return diagnostic.status();
}

dcloth_status dcloth_cloth_set_space(dcloth_cloth* cloth, const dcloth_space* space, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  dcloth_space described;
  if (cloth == nullptr) {
    Refuse("cloth", nullptr, "a null pointer", "a cloth", &diagnostic);
  } else if (ClothOf(cloth)->fit != nullptr) {
    RefuseFitted(&diagnostic);
  } else if (Read(space, "space", &described, &diagnostic)) {
    dcloth::engine::MakeSpace(described, &ClothOf(cloth)->rig.space, &diagnostic);
  }
  return diagnostic.status();
}

dcloth_status dcloth_cloth_set_bind_pose(dcloth_cloth* cloth, const dcloth_pose* bind, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  dcloth_pose pose;
  if (cloth == nullptr) {
    Refuse("cloth", nullptr, "a null pointer", "a cloth", &diagnostic);
  } else if (ClothOf(cloth)->fit != nullptr) {
    RefuseFitted(&diagnostic);
  } else if (ReadPose(bind, &pose, &diagnostic)) {
    dcloth::engine::TakeBindPose(*ClothOf(cloth)->model, pose, &ClothOf(cloth)->rig, &diagnostic);
  }
  return diagnostic.status();
}

dcloth_status dcloth_cloth_set_fit(dcloth_cloth* cloth, const void* fit, size_t size, dcloth_error* error) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(error);
  if (cloth == nullptr || fit == nullptr) {
    diagnostic.Fail(DCLOTH_ERROR_ARGUMENT, kNoOffset, nullptr, "a null pointer", "a cloth and the bytes of a fit", "");
    return diagnostic.status();
  }
  dcloth::engine::WearFit(fit, size, ClothOf(cloth), &diagnostic);
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
  return dcloth::engine::IsWhole(output) ? dcloth::engine::ScratchBytes(dcloth::engine::ReadStruct(*output)) : 0;
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
                         "lend as many bytes as dcloth_cloth_state_size returns");
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
  dcloth_frame read = {};
  if (dcloth::engine::IsWhole(frame)) read = dcloth::engine::ReadStruct(*frame);
  Diagnostic diagnostic(read.error);
  if (cloth == nullptr || !dcloth::engine::IsWhole(frame)) {
    Refuse(cloth == nullptr ? "cloth" : "frame", nullptr, kNoStruct, "a cloth and a frame", &diagnostic);
    return diagnostic.status();
  }
  const ModelView& model = *ClothOf(cloth)->model;
  dcloth_pose posed;
  dcloth_frame timed;
  dcloth_output drawn;
  if (!ReadPose(pose, &posed, &diagnostic) || !ReadFrame(read, model, &timed, &diagnostic) ||
      (output != nullptr && !ReadOutput(output, model, &drawn, &diagnostic)) || !CheckTimer(timer, &diagnostic)) {
    return diagnostic.status();
  }
  const FloatEnvironment arithmetic(ActiveSubnormals());
  const bool taken =
      dcloth::engine::UpdateCloth(ClothOf(cloth), posed, timed, output != nullptr ? &drawn : nullptr, timer);
  if (!taken) dcloth::engine::ExplainPose(model, ClothOf(cloth)->rig, posed, &diagnostic);
  return diagnostic.status();
}

dcloth_status dcloth_cloth_describe(const dcloth_cloth* cloth, dcloth_cloth_info* info) {
  const FloatEnvironment environment;
  if (cloth == nullptr || !dcloth::engine::IsWhole(info)) return DCLOTH_ERROR_ARGUMENT;
  dcloth_cloth_info filled = {};
  const Cloth& described = *reinterpret_cast<const Cloth*>(cloth);
  filled.in_work = dcloth::engine::TickInWork(described) ? 1 : 0;
  filled.lag_seconds = static_cast<float>(described.clock.lag() / static_cast<double>(described.model->tick_rate));
  filled.tick_share = described.work_done;
  filled.frozen = dcloth::engine::IsFrozen(described) ? 1 : 0;
  filled.tick_waits = described.clock.tick_waits() && filled.frozen == 0 ? 1 : 0;  // a frozen one wants none
  dcloth::engine::WriteStruct(filled, info);
  return DCLOTH_OK;
}

dcloth_status dcloth_cloth_tick(dcloth_cloth* cloth, const dcloth_pose* pose, uint32_t stages, dcloth_timer* timer) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(nullptr);
  dcloth_pose posed;
  if (cloth == nullptr || !ReadPose(pose, &posed, &diagnostic) || !CheckTimer(timer, &diagnostic) ||
      !TakeStages(*ClothOf(cloth)->model, "tick", &stages, &diagnostic)) {
    return DCLOTH_ERROR_ARGUMENT;
  }
  const FloatEnvironment arithmetic(ActiveSubnormals());
  return dcloth::engine::TickCloth(ClothOf(cloth), posed, stages, timer) ? DCLOTH_OK : DCLOTH_ERROR_POSE;
}

dcloth_status dcloth_cloth_skin(dcloth_cloth* cloth, const dcloth_pose* pose, float blend, const dcloth_output* output,
                                dcloth_timer* timer) {
  const FloatEnvironment environment;
  Diagnostic diagnostic(nullptr);
  dcloth_pose posed;
  dcloth_output drawn;
  const volatile float asked = blend;  // volatile: compared inside the environment, where a NaN does not trap
  if (cloth == nullptr || !ReadPose(pose, &posed, &diagnostic) || !CheckTimer(timer, &diagnostic) ||
      !(asked >= 0.0f && asked <= 1.0f) || !ReadOutput(output, *ClothOf(cloth)->model, &drawn, &diagnostic)) {
    return DCLOTH_ERROR_ARGUMENT;
  }
  const FloatEnvironment arithmetic(ActiveSubnormals());
  return dcloth::engine::SkinCloth(ClothOf(cloth), posed, blend, drawn, timer) ? DCLOTH_OK : DCLOTH_ERROR_POSE;
}

}  // extern "C"
