// The extension module `dcloth._engine`: the C ABI on NumPy arrays. It owns the memory that the engine is lent, gives
// the interpreter free while the engine works, and turns every status into dcloth.Error. The package beside it has the
// names, types and documentation that users see.
#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <exception>
#include <memory>
#include <mutex>
#include <new>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "dcloth/dcloth.h"
#include "dcloth/dcloth_fit.h"

namespace nb = nanobind;

namespace {

template <typename T, typename Shape>
using Array = nb::ndarray<const T, Shape, nb::c_contig, nb::device::cpu>;
using Bytes = Array<uint8_t, nb::ndim<1>>;
using Matrices = Array<float, nb::shape<-1, 4, 4>>;
using Vector = Array<float, nb::shape<3>>;
using Vertices =
    nb::ndarray<float, nb::shape<-1, 3>, nb::device::cpu>;  // of any stride: a vertex buffer may interleave

struct EngineError : std::exception {
  EngineError(dcloth_status failed, std::string why) : status(failed), text(std::move(why)) {}
  const char* what() const noexcept override { return text.c_str(); }
  dcloth_status status;
  std::string text;
};

dcloth_error NewError() {
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  return error;
}

void Check(dcloth_status status, const dcloth_error& error) {
  if (status != DCLOTH_OK) throw EngineError(status, error.text);
}

// Names come out of files: any bytes may be among them.
nb::str Text(const char* text) {
  PyObject* decoded = PyUnicode_DecodeUTF8(text, static_cast<Py_ssize_t>(std::strlen(text)), "replace");
  if (decoded == nullptr) throw nb::python_error();
  return nb::steal<nb::str>(decoded);
}

// Memory on DCLOTH_ALIGNMENT.
class Storage {
 public:
  explicit Storage(size_t size) : size_(size) {
    if (size > 0) bytes_.reset(::operator new (size, std::align_val_t{DCLOTH_ALIGNMENT}));
  }
  void* data() const { return bytes_.get(); }
  size_t size() const { return size_; }

 private:
  struct Free {
    void operator()(void* bytes) const { ::operator delete (bytes, std::align_val_t{DCLOTH_ALIGNMENT}); }
  };
  std::unique_ptr<void, Free> bytes_;
  size_t size_;
};

class Model {
 public:
  explicit Model(const Bytes& bytes) : bytes_(bytes.size()), view_(dcloth_model_storage_size()) {
    if (bytes.size() == 0) {
      throw EngineError(DCLOTH_ERROR_FORMAT, "the model: found 0 bytes, allowed: a .dcloth file; was the file read?");
    }
    std::memcpy(bytes_.data(), bytes.data(), bytes.size());
    dcloth_error error = NewError();
    const nb::gil_scoped_release free_interpreter;
    Check(dcloth_model_open(bytes_.data(), bytes_.size(), view_.data(), view_.size(), &model_, &error), error);
    info_.struct_size = sizeof(info_);
    Check(dcloth_model_describe(model_, &info_), error);
  }

  const dcloth_model* get() const { return model_; }
  const dcloth_model_info& info() const { return info_; }

 private:
  Storage bytes_, view_;
  dcloth_model* model_ = nullptr;
  dcloth_model_info info_ = {};
};

nb::list JointNames(const Model& model) {
  nb::list names;
  for (uint32_t j = 0; j < model.info().joint_count; ++j) names.append(Text(dcloth_model_joint_name(model.get(), j)));
  return names;
}

std::vector<int32_t> JointParents(const Model& model) {
  std::vector<int32_t> parents;
  for (uint32_t j = 0; j < model.info().joint_count; ++j) parents.push_back(dcloth_model_joint_parent(model.get(), j));
  return parents;
}

void JointBinds(const Model& model, nb::ndarray<float, nb::shape<-1, 4, 4>, nb::c_contig, nb::device::cpu> out) {
  for (uint32_t j = 0; j < out.shape(0); ++j) {
    const dcloth_status status = dcloth_model_joint_bind(model.get(), j, out.data() + size_t{16} * j);
    if (status == DCLOTH_OK) continue;
    const char* name = dcloth_model_joint_name(model.get(), j);
    throw EngineError(status, name == nullptr ? "there is no such joint"
                                              : std::string(name) + ": its bind matrix has no inverse; convert again");
  }
}

dcloth_pose Pose(const Matrices& matrices, bool column_major) {
  return {.struct_size = sizeof(dcloth_pose),
          .joint_count = static_cast<uint32_t>(matrices.shape(0)),
          .joint_matrices = matrices.data(),
          .column_major = column_major ? 1U : 0U,
          .padding = 0};
}

// Where the engine writes one attribute. It checks that the stride has room for the attribute.
void Attribute(const char* name, const std::optional<Vertices>& array, uint32_t vertex_count, void** data,
               uint32_t* stride_bytes) {
  if (!array) return;
  const int64_t stride = array->stride(0) * static_cast<int64_t>(sizeof(float));
  if (array->shape(0) != vertex_count) {
    throw EngineError(DCLOTH_ERROR_ARGUMENT, std::string(name) + ": found " + std::to_string(array->shape(0)) +
                                                 " rows, allowed: " + std::to_string(vertex_count) +
                                                 ", the model's vertex_count");
  }
  if (array->stride(1) != 1 || stride < 0 || stride > UINT32_MAX) {
    throw EngineError(DCLOTH_ERROR_ARGUMENT, std::string(name) +
                                                 ": found numbers of a row that do not follow each other, or rows in "
                                                 "reverse, allowed: rows of 3 float32 at growing addresses; give an "
                                                 "array of np.empty((n, 3), np.float32)");
  }
  *data = array->data();
  *stride_bytes = static_cast<uint32_t>(stride);
}

// What dcloth_cloth_fit reads, as arrays that stay alive during the call.
struct Body {
  Array<float, nb::shape<-1, 3>> positions;
  Array<uint32_t, nb::ndim<2>> joints;
  Array<float, nb::ndim<2>> weights;
  std::optional<Array<uint32_t, nb::shape<-1, 3>>> triangles;
};

class Cloth {
 public:
  explicit Cloth(std::shared_ptr<Model> model)
      : model_(std::move(model)), storage_(dcloth_cloth_storage_size(model_->get())), fit_storage_(0) {
    dcloth_error error = NewError();
    Check(dcloth_cloth_create(model_->get(), storage_.data(), storage_.size(), &cloth_, &error), error);
  }

  void BindJoints(const std::vector<std::string>& names) {
    const std::vector<const char*> pointers = Pointers(names);
    Call([&](dcloth_error* error) {
      return dcloth_cloth_bind_joints(cloth_, pointers.data(), static_cast<uint32_t>(pointers.size()), error);
    });
  }

  void SetSpace(uint32_t left, uint32_t up, uint32_t forward, float metres_per_unit, bool joint_frames_kept) {
    const dcloth_space space = {.struct_size = sizeof(space),
                                .left = left,
                                .up = up,
                                .forward = forward,
                                .metres_per_unit = metres_per_unit,
                                .joint_frames = static_cast<uint32_t>(
                                    joint_frames_kept ? DCLOTH_JOINT_FRAMES_KEPT : DCLOTH_JOINT_FRAMES_CONVERTED)};
    Call([&](dcloth_error* error) { return dcloth_cloth_set_space(cloth_, &space, error); });
  }

  void SetBindPose(const Matrices& matrices, bool column_major) {
    const dcloth_pose bind = Pose(matrices, column_major);
    Call([&](dcloth_error* error) { return dcloth_cloth_set_bind_pose(cloth_, &bind, error); });
  }

  void SetWind(const Vector& wind) {
    Call([&](dcloth_error* error) { return dcloth_cloth_set_wind(cloth_, wind.data(), error); });
  }

  // The bytes are copied to memory that the cloth uses from now on.
  void SetFit(const Bytes& bytes) {
    Storage fit(bytes.size());
    std::memcpy(fit.data(), bytes.data(), bytes.size());
    Call([&](dcloth_error* error) {
      const dcloth_status status = dcloth_cloth_set_fit(cloth_, fit.data(), fit.size(), error);
      if (status == DCLOTH_OK) fit_storage_ = std::move(fit);
      return status;
    });
  }

  // `roles` is empty or has one for each joint.
  nb::dict Fit(const std::vector<std::string>& names, const Matrices& binds, bool column_major,
               const std::vector<uint32_t>& roles, const std::optional<Body>& body) {
    const std::vector<const char*> pointers = Pointers(names);
    if (binds.shape(0) != names.size() || (!roles.empty() && roles.size() != names.size())) {
      throw EngineError(DCLOTH_ERROR_ARGUMENT, "bind_matrices: found " + std::to_string(binds.shape(0)) +
                                                   " matrices, allowed: " + std::to_string(names.size()) +
                                                   ", one for each joint name");
    }
    dcloth_character character = {};
    character.struct_size = sizeof(character);
    character.joint_count = static_cast<uint32_t>(names.size());
    character.joint_names = pointers.data();
    character.joint_roles = roles.empty() ? nullptr : roles.data();
    character.bind_matrices = binds.data();
    character.column_major = column_major ? 1 : 0;
    if (body) {
      if (body->joints.shape(0) != body->positions.shape(0) || body->weights.shape(0) != body->positions.shape(0) ||
          body->joints.shape(1) != body->weights.shape(1)) {
        throw EngineError(DCLOTH_ERROR_ARGUMENT,
                          "body_joints and body_weights: found other shapes than the body has, allowed: "
                          "[body vertices, influences] for both");
      }
      character.body_vertex_count = static_cast<uint32_t>(body->positions.shape(0));
      character.body_positions = body->positions.data();
      character.body_joints = body->joints.data();
      character.body_weights = body->weights.data();
      character.body_influences = static_cast<uint32_t>(body->joints.shape(1));
      if (body->triangles) {
        character.body_triangles = body->triangles->data();
        character.body_triangle_count = static_cast<uint32_t>(body->triangles->shape(0));
      }
    }
    Storage storage(dcloth_fit_storage_size(model_->get(), &character));
    dcloth_fit fit = {};
    fit.struct_size = sizeof(fit);
    Call([&](dcloth_error* error) {
      const dcloth_status status = dcloth_cloth_fit(cloth_, &character, storage.data(), storage.size(), &fit, error);
      if (status == DCLOTH_OK) fit_storage_ = std::move(storage);
      return status;
    });
    nb::dict result;
    result["warnings"] = fit.warnings;
    result["scale"] = fit.scale;
    result["bone_scale"] = fit.bone_scale;
    result["waist_ratio"] = fit.waist_ratio;
    result["hips_ratio"] = fit.hips_ratio;
    result["gap_mm"] = fit.gap_mm;
    result["penetration_mm"] = fit.penetration_mm;
    result["penetrating_share"] = fit.penetrating_share;
    result["stance_degrees"] = fit.stance_degrees;
    result["stance_role"] = dcloth_role_name(fit.stance_role);
    result["stand_in_role"] = dcloth_role_name(fit.stand_in_role);
    nb::dict ratios, joints;
    for (uint32_t role = 1; role < DCLOTH_FIT_ROLES && dcloth_role_name(role) != nullptr; ++role) {
      if (fit.ratios[role] > 0) ratios[dcloth_role_name(role)] = fit.ratios[role];
      if (fit.joints[role] >= 0) joints[dcloth_role_name(role)] = fit.joints[role];
    }
    result["ratios"] = ratios;
    result["joints"] = joints;
    return result;
  }

  void Reset() {
    Call([&](dcloth_error*) { return dcloth_cloth_reset(cloth_); });
  }

  nb::bytes Save() {
    std::vector<char> state;
    Call([&](dcloth_error* error) {
      state.resize(dcloth_cloth_state_size(cloth_));
      return dcloth_cloth_save(cloth_, state.data(), state.size(), error);
    });
    return nb::bytes(state.data(), state.size());
  }

  void Restore(const Bytes& state, bool other_model) {
    const uint32_t flags = other_model ? uint32_t{DCLOTH_RESTORE_OTHER_MODEL} : 0;
    Call([&](dcloth_error* error) { return dcloth_cloth_restore(cloth_, state.data(), state.size(), flags, error); });
  }

  // Draws nothing without positions and normals.
  void Update(const Matrices& matrices, bool column_major, float seconds, uint32_t stages, uint32_t flags,
              uint32_t output_flags, const std::optional<Vertices>& positions, const std::optional<Vertices>& normals) {
    const dcloth_pose pose = Pose(matrices, column_major);
    dcloth_output output = {};
    output.struct_size = sizeof(output);
    output.vertex_count = model_->info().vertex_count;
    output.flags = output_flags;
    Attribute("positions", positions, output.vertex_count, &output.positions, &output.position_stride_bytes);
    Attribute("normals", normals, output.vertex_count, &output.normals, &output.normal_stride_bytes);
    const bool draws = positions || normals;
    Call([&](dcloth_error* error) {
      const dcloth_frame frame = {
          .struct_size = sizeof(frame), .stages = stages, .seconds = seconds, .flags = flags, .error = error};
      return dcloth_cloth_update(cloth_, &pose, &frame, draws ? &output : nullptr, nullptr);
    });
  }

  std::tuple<bool, float, float, bool, bool> Describe() {
    dcloth_cloth_info info = {};
    info.struct_size = sizeof(info);
    Call([&](dcloth_error*) { return dcloth_cloth_describe(cloth_, &info); });
    return {info.in_work != 0, info.lag_seconds, info.tick_share, info.frozen != 0, info.tick_waits != 0};
  }

 private:
  static std::vector<const char*> Pointers(const std::vector<std::string>& names) {
    std::vector<const char*> pointers;
    for (const std::string& name : names) pointers.push_back(name.c_str());
    return pointers;
  }

  // Other Python threads run meanwhile. Calls on one cloth wait for each other, as the engine asks for.
  template <typename Function>
  void Call(const Function& function) {
    dcloth_error error = NewError();
    const nb::gil_scoped_release free_interpreter;
    const std::lock_guard alone(mutex_);
    Check(function(&error), error);
  }

  std::shared_ptr<Model> model_;
  Storage storage_, fit_storage_;
  std::mutex mutex_;
  dcloth_cloth* cloth_ = nullptr;
};

// An array in the model's own bytes, which `model` keeps alive.
template <typename T>
nb::ndarray<nb::numpy, const T> View(nb::handle model, const T* data, size_t rows, size_t columns = 3) {
  return nb::ndarray<nb::numpy, const T>(data, {rows, columns}, model);
}

void Translate(const std::exception_ptr& thrown, void*) {
  try {
    std::rethrow_exception(thrown);
  } catch (const EngineError& error) {
    const nb::object type = nb::module_::import_("dcloth._error").attr("Error");
    const nb::object value = type(dcloth_status_name(error.status), Text(error.text.c_str()));
    PyErr_SetObject(type.ptr(), value.ptr());
  }
}

}  // namespace

NB_MODULE(_engine, m) {
  using nb::arg;
  nb::register_exception_translator(Translate);

  m.attr("STAGES_STATIC") = static_cast<int>(DCLOTH_STAGES_STATIC);
  m.attr("STAGES_SKELETON") = static_cast<int>(DCLOTH_STAGES_SKELETON);
  m.attr("STAGES_MESH") = static_cast<int>(DCLOTH_STAGES_MESH);
  m.attr("FRAME_PIPELINED") = static_cast<int>(DCLOTH_FRAME_PIPELINED);
  m.attr("FRAME_JUMPED") = static_cast<int>(DCLOTH_FRAME_JUMPED);
  m.attr("FRAME_HOLD") = static_cast<int>(DCLOTH_FRAME_HOLD);
  m.attr("FRAME_FREEZE_IDLE") = static_cast<int>(DCLOTH_FRAME_FREEZE_IDLE);
  m.attr("OUTPUT_OUTSIDE_BODY") = static_cast<int>(DCLOTH_OUTPUT_OUTSIDE_BODY);
  m.attr("AXIS_X") = static_cast<int>(DCLOTH_AXIS_X);
  m.attr("AXIS_MINUS_X") = static_cast<int>(DCLOTH_AXIS_MINUS_X);
  m.attr("AXIS_Y") = static_cast<int>(DCLOTH_AXIS_Y);
  m.attr("AXIS_MINUS_Y") = static_cast<int>(DCLOTH_AXIS_MINUS_Y);
  m.attr("AXIS_Z") = static_cast<int>(DCLOTH_AXIS_Z);
  m.attr("AXIS_MINUS_Z") = static_cast<int>(DCLOTH_AXIS_MINUS_Z);
  m.attr("FIT_STAND_IN") = static_cast<int>(DCLOTH_FIT_STAND_IN);
  m.attr("FIT_PROPORTIONS") = static_cast<int>(DCLOTH_FIT_PROPORTIONS);
  m.attr("FIT_STANCE") = static_cast<int>(DCLOTH_FIT_STANCE);
  m.attr("FIT_GIRTH") = static_cast<int>(DCLOTH_FIT_GIRTH);
  m.attr("FIT_GAP") = static_cast<int>(DCLOTH_FIT_GAP);
  m.attr("FIT_PENETRATION") = static_cast<int>(DCLOTH_FIT_PENETRATION);
  m.attr("FIT_FACING") = static_cast<int>(DCLOTH_FIT_FACING);

  m.def("version", [] { return dcloth_version(); });
  m.def("isa_name", [] { return dcloth_isa_name(); });
  m.def("role_names", [] {
    nb::list names;
    for (uint32_t role = 0; role < DCLOTH_FIT_ROLES && dcloth_role_name(role) != nullptr; ++role) {
      names.append(dcloth_role_name(role));
    }
    return names;
  });

  nb::class_<Model>(m, "Model")
      .def(nb::init<const Bytes&>(), arg("bytes"))
      .def_prop_ro("name", [](const Model& model) { return Text(model.info().name); })
      .def_prop_ro("precision", [](const Model& model) { return Text(model.info().precision); })
      .def_prop_ro("joint_count", [](const Model& model) { return model.info().joint_count; })
      .def_prop_ro("vertex_count", [](const Model& model) { return model.info().vertex_count; })
      .def_prop_ro("triangle_count", [](const Model& model) { return model.info().triangle_count; })
      .def_prop_ro("stages", [](const Model& model) { return model.info().stages; })
      .def_prop_ro("tick_seconds", [](const Model& model) { return model.info().tick_seconds; })
      .def_prop_ro("format",
                   [](const Model& model) { return std::tuple(model.info().format_major, model.info().format_minor); })
      .def_prop_ro("reads_wind", [](const Model& model) { return dcloth_model_reads_wind(model.get()) != 0; })
      .def_prop_ro("body_vertex_count", [](const Model& model) { return dcloth_model_body_vertex_count(model.get()); })
      .def_prop_ro("cloth_bytes", [](const Model& model) { return dcloth_cloth_storage_size(model.get()); })
      .def("joint_names", &JointNames)
      .def("joint_parents", &JointParents)
      .def("joint_binds", &JointBinds, arg("out").noconvert())
      .def("triangles",
           [](nb::handle_t<Model> self) {
             const dcloth_model_info& info = nb::cast<const Model&>(self).info();
             return View(self, info.triangles, info.triangle_count);
           })
      .def("texture_coordinates",
           [](nb::handle_t<Model> self) {
             const dcloth_model_info& info = nb::cast<const Model&>(self).info();
             return View(self, info.texture_coordinates, info.textured_vertex_count, 2);
           })
      .def("textured_triangles",
           [](nb::handle_t<Model> self) {
             const dcloth_model_info& info = nb::cast<const Model&>(self).info();
             return View(self, info.textured_triangles, info.textured_vertex_count == 0 ? 0 : info.triangle_count);
           })
      .def("seam_vertices",
           [](nb::handle_t<Model> self) {
             const dcloth_model_info& info = nb::cast<const Model&>(self).info();
             return View(self, info.seam_vertices, info.seam_vertex_count, 1);
           })
      .def("positions", [](nb::handle_t<Model> self) {
        const dcloth_model_info& info = nb::cast<const Model&>(self).info();
        return View(self, info.positions, info.vertex_count);
      });

  nb::class_<Cloth>(m, "Cloth")
      .def(nb::init<std::shared_ptr<Model>>(), arg("model"))
      .def("bind_joints", &Cloth::BindJoints, arg("names"))
      .def("set_space", &Cloth::SetSpace, arg("left"), arg("up"), arg("forward"), arg("metres_per_unit"),
           arg("joint_frames_kept"))
      .def("set_bind_pose", &Cloth::SetBindPose, arg("joint_matrices").noconvert(), arg("column_major"))
      .def("set_wind", &Cloth::SetWind, arg("wind").noconvert())
      .def(
          "fit",
          [](Cloth& cloth, const std::vector<std::string>& names, const Matrices& binds, bool column_major,
             const std::vector<uint32_t>& roles, const std::optional<Array<float, nb::shape<-1, 3>>>& positions,
             const std::optional<Array<uint32_t, nb::ndim<2>>>& joints,
             const std::optional<Array<float, nb::ndim<2>>>& weights,
             const std::optional<Array<uint32_t, nb::shape<-1, 3>>>& triangles) {
            std::optional<Body> body;
            if (positions && joints && weights) body = Body{*positions, *joints, *weights, triangles};
            return cloth.Fit(names, binds, column_major, roles, body);
          },
          arg("names"), arg("bind_matrices").noconvert(), arg("column_major"), arg("roles"),
          arg("body_positions").noconvert().none(), arg("body_joints").noconvert().none(),
          arg("body_weights").noconvert().none(), arg("body_triangles").noconvert().none())
      .def("reset", &Cloth::Reset)
      .def("save", &Cloth::Save)
      .def("set_fit", &Cloth::SetFit, arg("fit"))
      .def("restore", &Cloth::Restore, arg("state"), arg("other_model"))
      .def("update", &Cloth::Update, arg("joint_matrices").noconvert(), arg("column_major"), arg("seconds"),
           arg("stages"), arg("flags"), arg("output_flags"), arg("positions").noconvert().none(),
           arg("normals").noconvert().none())
      .def("describe", &Cloth::Describe);
}
