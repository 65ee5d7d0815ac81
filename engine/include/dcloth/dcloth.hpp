// dcloth for C++17: the C ABI of dcloth.h and dcloth_scene.h with types in place of pointers and struct sizes. Nothing
// here allocates, throws or owns: bytes and storage stay the host's and outlive what is opened in them.
#ifndef DCLOTH_DCLOTH_HPP_
#define DCLOTH_DCLOTH_HPP_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_scene.h"

namespace dcloth {

// [[nodiscard]]: a refused pose or model must not go unseen.
enum class [[nodiscard]] Status : dcloth_status{
    kOk = DCLOTH_OK,
    kArgument = DCLOTH_ERROR_ARGUMENT,
    kAlignment = DCLOTH_ERROR_ALIGNMENT,
    kMemory = DCLOTH_ERROR_MEMORY,
    kFormat = DCLOTH_ERROR_FORMAT,
    kVersion = DCLOTH_ERROR_VERSION,
    kSemantics = DCLOTH_ERROR_SEMANTICS,
    kPose = DCLOTH_ERROR_POSE,
    kJoints = DCLOTH_ERROR_JOINTS,
    kModel = DCLOTH_ERROR_MODEL,
};

inline const char* StatusName(Status status) { return dcloth_status_name(static_cast<dcloth_status>(status)); }

enum class Stages : uint32_t {
  kStatic = DCLOTH_STAGES_STATIC,
  kSkeleton = DCLOTH_STAGES_SKELETON,
  kMesh = DCLOTH_STAGES_MESH,
};

enum class MatrixLayout : uint32_t { kRowMajor = 0, kColumnMajor = 1 };

// dcloth_error with its size filled in.
struct Error : dcloth_error {
  Error() : dcloth_error{} { struct_size = sizeof(dcloth_error); }
};

// dcloth_timer with its size filled in.
struct Timer : dcloth_timer {
  Timer(uint64_t (*clock)(void*), void* clock_context) : dcloth_timer{} {
    struct_size = sizeof(dcloth_timer);
    now = clock;
    context = clock_context;
  }
};

// One world matrix per joint of the model, 16 floats each; `matrices` outlives the call only.
inline dcloth_pose MakePose(const float* matrices, uint32_t joint_count,
                            MatrixLayout layout = MatrixLayout::kRowMajor) {
  return {sizeof(dcloth_pose), joint_count, matrices, static_cast<uint32_t>(layout), 0};
}

// `flags` are DCLOTH_FRAME_*; `error` outlives the updates that are given the frame.
inline dcloth_frame MakeFrame(float seconds, Stages stages, uint32_t flags = 0, dcloth_error* error = nullptr) {
  return {sizeof(dcloth_frame), static_cast<uint32_t>(stages), seconds, flags, error};
}

// Tightly packed float arrays; `normals` may be null. Other layouts start from this one.
inline dcloth_output MakeOutput(float* positions, float* normals, uint32_t vertex_count) {
  dcloth_output output = {};
  output.struct_size = sizeof(output);
  output.vertex_count = vertex_count;
  output.positions = positions;
  output.normals = normals;
  output.position_stride_bytes = output.normal_stride_bytes = 3 * sizeof(float);
  return output;
}

// DCLOTH_AXIS_*, see dcloth_space.
inline dcloth_space MakeSpace(uint32_t left, uint32_t up, uint32_t forward, float metres_per_unit) {
  return {sizeof(dcloth_space), left, up, forward, metres_per_unit, DCLOTH_JOINT_FRAMES_CONVERTED};
}

// A view of model bytes. Copies are further views of the same model.
class Model {
 public:
  static size_t StorageSize() { return dcloth_model_storage_size(); }

  Status Open(const void* bytes, size_t size, void* storage, size_t storage_size, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_model_open(bytes, size, storage, storage_size, &model_, error));
  }

  bool is_open() const { return model_ != nullptr; }

  // All zero where no model is open.
  dcloth_model_info Describe() const {
    dcloth_model_info info = {};
    info.struct_size = sizeof(info);
    (void)dcloth_model_describe(model_, &info);
    return info;
  }

  const char* JointName(uint32_t index) const { return dcloth_model_joint_name(model_, index); }
  // [16], rows contiguous; see dcloth_model_joint_bind.
  Status JointBind(uint32_t index, float* matrix) const {
    return static_cast<Status>(dcloth_model_joint_bind(model_, index, matrix));
  }
  // An index, or DCLOTH_JOINT_*.
  int32_t JointParent(uint32_t index) const { return dcloth_model_joint_parent(model_, index); }
  // This garment's output with packed floats; see dcloth_model_output. All zero where no model is open.
  dcloth_output Output(float* positions, float* normals = nullptr) const {
    dcloth_output output = {};
    output.struct_size = sizeof(output);
    if (dcloth_model_output(model_, &output) != DCLOTH_OK) return output;
    output.positions = positions;
    output.normals = normals;
    return output;
  }
  uint32_t BodyVertexCount() const { return dcloth_model_body_vertex_count(model_); }
  bool ReadsWind() const { return dcloth_model_reads_wind(model_) != 0; }
  size_t ClothStorageSize() const { return dcloth_cloth_storage_size(model_); }
  const dcloth_model* get() const { return model_; }

 private:
  dcloth_model* model_ = nullptr;
};

// One garment on one character. Copies name the same cloth.
class Cloth {
 public:
  Status Create(const Model& model, void* storage, size_t storage_size, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_cloth_create(model.get(), storage, storage_size, &cloth_, error));
  }

  bool is_created() const { return cloth_ != nullptr; }

  // Poses hold one matrix per name from now on.
  Status BindJoints(const char* const* names, uint32_t count, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_cloth_bind_joints(cloth_, names, count, error));
  }

  Status SetSpace(const dcloth_space& space, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_cloth_set_space(cloth_, &space, error));
  }

  // Joints with axes of their own; see dcloth_cloth_set_bind_pose.
  Status SetBindPose(const dcloth_pose& bind, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_cloth_set_bind_pose(cloth_, &bind, error));
  }

  // The bytes of a .dcloth-fit; see dcloth_cloth_set_fit.
  Status SetFit(const void* fit, size_t size, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_cloth_set_fit(cloth_, fit, size, error));
  }

  // See dcloth_cloth_set_wind.
  Status SetWind(const float (&wind)[3], dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_cloth_set_wind(cloth_, wind, error));
  }

  Status Reset() { return static_cast<Status>(dcloth_cloth_reset(cloth_)); }

  size_t StateSize() const { return dcloth_cloth_state_size(cloth_); }

  Status Save(void* state, size_t size, dcloth_error* error = nullptr) const {
    return static_cast<Status>(dcloth_cloth_save(cloth_, state, size, error));
  }

  // `flags` are DCLOTH_RESTORE_*.
  Status Restore(const void* state, size_t size, uint32_t flags = 0, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_cloth_restore(cloth_, state, size, flags, error));
  }

  // `output` may be null.
  Status Update(const dcloth_pose& pose, const dcloth_frame& frame, const dcloth_output* output,
                dcloth_timer* timer = nullptr) {
    return static_cast<Status>(dcloth_cloth_update(cloth_, &pose, &frame, output, timer));
  }

  // All zero where no cloth is created.
  dcloth_cloth_info Describe() const {
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    (void)dcloth_cloth_describe(cloth_, &info);
    return info;
  }

  Status Tick(const dcloth_pose& pose, Stages stages, dcloth_timer* timer = nullptr) {
    return static_cast<Status>(dcloth_cloth_tick(cloth_, &pose, static_cast<uint32_t>(stages), timer));
  }

  Status Skin(const dcloth_pose& pose, float blend, const dcloth_output& output, dcloth_timer* timer = nullptr) {
    return static_cast<Status>(dcloth_cloth_skin(cloth_, &pose, blend, &output, timer));
  }

  dcloth_cloth* get() const { return cloth_; }

 private:
  dcloth_cloth* cloth_ = nullptr;
};

// A scene of many characters in one budget. Copies name the same scene.
class Scene {
 public:
  // 0 where there is no such scene.
  static size_t StorageSize(uint32_t character_count) { return dcloth_scene_storage_size(character_count); }

  Status Create(uint32_t character_count, void* storage, size_t storage_size, dcloth_error* error = nullptr) {
    return static_cast<Status>(dcloth_scene_create(character_count, storage, storage_size, &scene_, error));
  }

  Status Set(uint32_t index, const dcloth_scene_character& character) {
    return static_cast<Status>(dcloth_scene_set(scene_, index, &character));
  }

  Status Clear(uint32_t index) { return static_cast<Status>(dcloth_scene_set(scene_, index, nullptr)); }

  Status SetImportance(uint32_t index, float importance) {
    return static_cast<Status>(dcloth_scene_set_importance(scene_, index, importance));
  }

  // `spent_microseconds` of the plan before, 0 where it was not measured.
  Status Plan(float seconds, float budget_microseconds, float spent_microseconds = 0,
              float* planned_microseconds = nullptr) {
    const dcloth_scene_frame frame = {sizeof(dcloth_scene_frame), seconds, budget_microseconds, spent_microseconds};
    return static_cast<Status>(dcloth_scene_plan(scene_, &frame, planned_microseconds));
  }

  // All zero for an empty slot.
  dcloth_scene_choice Get(uint32_t index) const {
    dcloth_scene_choice choice = {};
    choice.struct_size = sizeof(choice);
    (void)dcloth_scene_get(scene_, index, &choice);
    return choice;
  }

  dcloth_scene* get() const { return scene_; }

 private:
  dcloth_scene* scene_ = nullptr;
};

}  // namespace dcloth

#endif  // DCLOTH_DCLOTH_HPP_
