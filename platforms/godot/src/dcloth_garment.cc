#include "dcloth_garment.h"

#include <algorithm>
#include <cstring>
#include <godot_cpp/classes/array_mesh.hpp>
#include <godot_cpp/classes/engine.hpp>
#include <godot_cpp/classes/rendering_server.hpp>
#include <godot_cpp/core/class_db.hpp>
#include <godot_cpp/core/object.hpp>
#include <godot_cpp/variant/callable_method_pointer.hpp>
#include <godot_cpp/variant/utility_functions.hpp>

#include "wearer.h"

using namespace godot;
using dcloth::platforms::GarmentModel;
using dcloth::platforms::Match;

namespace {

constexpr dcloth_space kSpace = {sizeof(dcloth_space),         DCLOTH_AXIS_X, DCLOTH_AXIS_Y, DCLOTH_AXIS_Z, 1,
                                 DCLOTH_JOINT_FRAMES_CONVERTED};
constexpr double kReach = 100;         // metres; floats are 8 um apart there
constexpr int kAfterAnimation = 1000;  // of the frame's order of nodes

}  // namespace

DClothGarment::DClothGarment() {
  set_as_top_level(true);
  set_skeleton_path(NodePath());  // its vertices are posed already
  set_process_priority(kAfterAnimation);
}

void DClothGarment::_notification(int what) {
  if (Engine::get_singleton()->is_editor_hint()) return;
  switch (what) {
    case NOTIFICATION_READY:
      set_process_internal(true);
      break;
    case NOTIFICATION_EXIT_TREE:
      Undress();
      break;
    case NOTIFICATION_INTERNAL_PROCESS:
      if (garment_ == nullptr && !refused_) Dress();
      // A skeleton applies its modifiers in a deferred call of the same frame, before this one.
      if (garment_ != nullptr) callable_mp(this, &DClothGarment::Step).call_deferred(get_process_delta_time());
      break;
    default:
      break;
  }
}

Skeleton3D* DClothGarment::Character() const {
  Node* const node = character_.is_empty() ? get_parent() : get_node_or_null(character_);
  return Object::cast_to<Skeleton3D>(node);
}

void DClothGarment::Dress() {
  Skeleton3D* const skeleton = Character();
  if (model_.is_null() || skeleton == nullptr) {
    return Refuse("needs a model (a .dcloth file) and a character (a Skeleton3D: its parent, or set 'character')");
  }
  if (model_->model() == nullptr) return Refuse("its model is empty; load a .dcloth file");
  std::vector<const MeshInstance3D*> bodies;
  if (!body_.is_empty()) {
    const MeshInstance3D* const body = Object::cast_to<MeshInstance3D>(get_node_or_null(body_));
    if (body == nullptr) return Refuse("'body' names no MeshInstance3D");
    bodies.push_back(body);
  } else {
    for (int i = 0; i < skeleton->get_child_count(); ++i) {
      const MeshInstance3D* const body = Object::cast_to<MeshInstance3D>(skeleton->get_child(i));
      if (body != nullptr && body != this) bodies.push_back(body);
    }
  }
  const Match match = fit_ == FIT_BODY ? Match::kBody : fit_ == FIT_BONES ? Match::kBones : Match::kNames;
  std::string error;
  garment_ = Garment::Create(model_->model(), kSpace, WearerOf(*skeleton, bodies, fit_ == FIT_BODY), match, &error);
  if (garment_ == nullptr) return Refuse(error);
  error_.clear();
  skeleton_id_ = skeleton->get_instance_id();
  skeleton->connect("skeleton_updated", callable_mp(this, &DClothGarment::TakePose));
  TakePose();
  set_wind(wind_);
  Prepare();
}

void DClothGarment::Undress() {
  refused_ = false;
  if (garment_ == nullptr) return;
  Skeleton3D* const skeleton = Object::cast_to<Skeleton3D>(ObjectDB::get_instance(skeleton_id_));
  const Callable take = callable_mp(this, &DClothGarment::TakePose);
  if (skeleton != nullptr && skeleton->is_connected("skeleton_updated", take)) {
    skeleton->disconnect("skeleton_updated", take);
  }
  garment_.reset();
  set_mesh(Ref<Mesh>());
}

void DClothGarment::Prepare() {
  const GarmentModel& model = garment_->model();
  const std::vector<int32_t> corners = model.Triangles(GarmentModel::Front::kClockwise);
  PackedVector3Array points, normals;
  PackedInt32Array index;
  points.resize(model.vertex_count());
  normals.resize(model.vertex_count());
  normals.fill(Vector3(0, 1, 0));
  index.resize(static_cast<int64_t>(corners.size()));
  std::copy(corners.begin(), corners.end(), index.ptrw());
  Array arrays;
  arrays.resize(Mesh::ARRAY_MAX);
  arrays[Mesh::ARRAY_VERTEX] = points;
  arrays[Mesh::ARRAY_NORMAL] = normals;
  arrays[Mesh::ARRAY_INDEX] = index;
  if (model.is_textured()) {
    PackedVector2Array places;
    for (uint32_t v = 0; v < model.vertex_count(); ++v) {
      const float* const at = model.texture_coordinates() + 2 * size_t{v};
      places.push_back(Vector2(at[0], at[1]));
    }
    arrays[Mesh::ARRAY_TEX_UV] = places;
  }
  Ref<ArrayMesh> mesh;
  mesh.instantiate();
  mesh->add_surface_from_arrays(Mesh::PRIMITIVE_TRIANGLES, arrays, TypedArray<Array>(), Dictionary(),
                                Mesh::ARRAY_FLAG_USE_DYNAMIC_UPDATE);

  // Where the server keeps positions (three floats) and normals (two numbers of 16 bits).
  RenderingServer* const server = RenderingServer::get_singleton();
  const BitField<RenderingServer::ArrayFormat> format = static_cast<int64_t>(mesh->surface_get_format(0));
  const auto count = static_cast<int32_t>(points.size());
  position_stride_ = server->mesh_surface_get_format_vertex_stride(format, count);
  normal_stride_ = server->mesh_surface_get_format_normal_tangent_stride(format, count);
  normal_offset_ = server->mesh_surface_get_format_offset(format, count, Mesh::ARRAY_NORMAL);
  vertices_.resize(std::max<int64_t>(position_stride_ * count, normal_offset_ + normal_stride_ * count));
  vertices_.fill(0);
  set_mesh(mesh);
}

void DClothGarment::TakePose() {
  const Skeleton3D* const skeleton = Object::cast_to<Skeleton3D>(ObjectDB::get_instance(skeleton_id_));
  if (skeleton == nullptr) return;
  pose_.resize(static_cast<size_t>(skeleton->get_bone_count()));
  for (size_t b = 0; b < pose_.size(); ++b) pose_[b] = skeleton->get_bone_global_pose(static_cast<int32_t>(b));
}

void DClothGarment::Step(double seconds) {
  const Skeleton3D* const skeleton = Object::cast_to<Skeleton3D>(ObjectDB::get_instance(skeleton_id_));
  if (garment_ == nullptr) return;
  if (skeleton == nullptr || pose_.size() != garment_->joint_count()) return Undress();  // another skeleton by now
  const Transform3D to_world = skeleton->get_global_transform();
  const double place[3] = {to_world.origin.x, to_world.origin.y, to_world.origin.z};
  if (garment_->Follow(place, kReach)) {
    const double* const at = garment_->origin();
    set_global_transform(Transform3D(Basis(), Vector3(real_t(at[0]), real_t(at[1]), real_t(at[2]))));
  }
  for (size_t b = 0; b < pose_.size(); ++b) {
    double columns[16];
    PutColumns(to_world * pose_[b], columns);
    garment_->SetJoint(b, columns);
  }
  constexpr uint32_t kStages[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};
  frame_.seconds = static_cast<float>(seconds);
  frame_.stages = kStages[detail_];
  frame_.draw = is_visible_in_tree();
  std::string error;
  if (!garment_->Update(frame_, &error)) {
    if (error != error_) UtilityFunctions::push_error("dcloth: ", get_name(), ": ", String::utf8(error.c_str()));
    error_ = error;
    return;
  }
  error_.clear();
  if (frame_.draw) Upload();
}

void DClothGarment::Upload() {
  const std::vector<float>&positions = garment_->positions(), &normals = garment_->normals();
  uint8_t* const bytes = vertices_.ptrw();
  for (size_t v = 0; v < positions.size() / 3; ++v) {
    const auto at = static_cast<int64_t>(v);
    std::memcpy(bytes + at * position_stride_, &positions[3 * v], 3 * sizeof(float));
    const Vector2 folded = Vector3(normals[3 * v], normals[3 * v + 1], normals[3 * v + 2]).octahedron_encode();
    const uint16_t numbers[2] = {static_cast<uint16_t>(std::clamp(folded.x * 65535, real_t(0), real_t(65535))),
                                 static_cast<uint16_t>(std::clamp(folded.y * 65535, real_t(0), real_t(65535)))};
    std::memcpy(bytes + normal_offset_ + at * normal_stride_, numbers, sizeof(numbers));
  }
  const Ref<ArrayMesh> mesh = get_mesh();
  if (mesh.is_null()) return;  // a script took it
  mesh->surface_update_vertex_region(0, 0, vertices_);
  const float* const b = garment_->bounds();
  set_custom_aabb(AABB(Vector3(b[0], b[1], b[2]), Vector3(b[3] - b[0], b[4] - b[1], b[5] - b[2])));
}

void DClothGarment::Refuse(const std::string& error) {
  error_ = error;
  refused_ = true;
  UtilityFunctions::push_error("dcloth: ", get_name(), ": ", String::utf8(error.c_str()));
}

void DClothGarment::set_model(const Ref<DClothModel>& model) {
  model_ = model;
  Undress();
}

void DClothGarment::set_character(const NodePath& path) {
  character_ = path;
  Undress();
}

void DClothGarment::set_body(const NodePath& path) {
  body_ = path;
  Undress();
}

void DClothGarment::set_fit(Fit fit) {
  fit_ = fit;
  Undress();
}

void DClothGarment::set_wind(const Vector3& wind) {
  wind_ = wind;
  const float air[3] = {static_cast<float>(wind.x), static_cast<float>(wind.y), static_cast<float>(wind.z)};
  std::string error;
  if (garment_ != nullptr && !garment_->SetWind(air, &error)) {
    UtilityFunctions::push_error("dcloth: ", get_name(), ": ", String::utf8(error.c_str()));
  }
}

void DClothGarment::jump() {
  if (garment_ != nullptr) garment_->Jump();
}

void DClothGarment::reset() {
  if (garment_ != nullptr) garment_->Reset();
}

Dictionary DClothGarment::get_fit_report() const {
  Dictionary report;
  if (garment_ == nullptr || garment_->fit().struct_size == 0) return report;
  const dcloth_fit& fit = garment_->fit();
  report["scale"] = fit.scale;
  report["warnings"] = fit.warnings;
  report["gap_mm"] = fit.gap_mm;
  report["penetration_mm"] = fit.penetration_mm;
  report["waist_ratio"] = fit.waist_ratio;
  report["hips_ratio"] = fit.hips_ratio;
  return report;
}

void DClothGarment::_bind_methods() {
  const auto property = [](Variant::Type type, const char* name, const char* getter, const char* setter,
                           PropertyHint hint = PROPERTY_HINT_NONE, const char* text = "") {
    ClassDB::add_property(get_class_static(), PropertyInfo(type, name, hint, text), setter, getter);
  };
  ClassDB::bind_method(D_METHOD("set_model", "model"), &DClothGarment::set_model);
  ClassDB::bind_method(D_METHOD("get_model"), &DClothGarment::get_model);
  property(Variant::OBJECT, "model", "get_model", "set_model", PROPERTY_HINT_RESOURCE_TYPE, "DClothModel");
  ClassDB::bind_method(D_METHOD("set_character", "path"), &DClothGarment::set_character);
  ClassDB::bind_method(D_METHOD("get_character"), &DClothGarment::get_character);
  property(Variant::NODE_PATH, "character", "get_character", "set_character", PROPERTY_HINT_NODE_PATH_VALID_TYPES,
           "Skeleton3D");
  ClassDB::bind_method(D_METHOD("set_body", "path"), &DClothGarment::set_body);
  ClassDB::bind_method(D_METHOD("get_body"), &DClothGarment::get_body);
  property(Variant::NODE_PATH, "body", "get_body", "set_body", PROPERTY_HINT_NODE_PATH_VALID_TYPES, "MeshInstance3D");
  ClassDB::bind_method(D_METHOD("set_fit", "fit"), &DClothGarment::set_fit);
  ClassDB::bind_method(D_METHOD("get_fit"), &DClothGarment::get_fit);
  property(Variant::INT, "fit", "get_fit", "set_fit", PROPERTY_HINT_ENUM, "Body,Bones,Names");
  ClassDB::bind_method(D_METHOD("set_detail", "detail"), &DClothGarment::set_detail);
  ClassDB::bind_method(D_METHOD("get_detail"), &DClothGarment::get_detail);
  property(Variant::INT, "detail", "get_detail", "set_detail", PROPERTY_HINT_ENUM, "Static,Skeleton,Mesh");
  ClassDB::bind_method(D_METHOD("set_pipelined", "on"), &DClothGarment::set_pipelined);
  ClassDB::bind_method(D_METHOD("is_pipelined"), &DClothGarment::is_pipelined);
  property(Variant::BOOL, "pipelined", "is_pipelined", "set_pipelined");
  ClassDB::bind_method(D_METHOD("set_half_rate_mesh", "on"), &DClothGarment::set_half_rate_mesh);
  ClassDB::bind_method(D_METHOD("is_half_rate_mesh"), &DClothGarment::is_half_rate_mesh);
  property(Variant::BOOL, "half_rate_mesh", "is_half_rate_mesh", "set_half_rate_mesh");
  ClassDB::bind_method(D_METHOD("set_freeze_idle", "on"), &DClothGarment::set_freeze_idle);
  ClassDB::bind_method(D_METHOD("is_freeze_idle"), &DClothGarment::is_freeze_idle);
  property(Variant::BOOL, "freeze_idle", "is_freeze_idle", "set_freeze_idle");
  ClassDB::bind_method(D_METHOD("set_outside_body", "on"), &DClothGarment::set_outside_body);
  ClassDB::bind_method(D_METHOD("is_outside_body"), &DClothGarment::is_outside_body);
  property(Variant::BOOL, "outside_body", "is_outside_body", "set_outside_body");
  ClassDB::bind_method(D_METHOD("set_wind", "wind"), &DClothGarment::set_wind);
  ClassDB::bind_method(D_METHOD("get_wind"), &DClothGarment::get_wind);
  property(Variant::VECTOR3, "wind", "get_wind", "set_wind", PROPERTY_HINT_NONE, "suffix:m/s");
  ClassDB::bind_method(D_METHOD("jump"), &DClothGarment::jump);
  ClassDB::bind_method(D_METHOD("reset"), &DClothGarment::reset);
  ClassDB::bind_method(D_METHOD("is_dressed"), &DClothGarment::is_dressed);
  ClassDB::bind_method(D_METHOD("get_error"), &DClothGarment::get_error);
  ClassDB::bind_method(D_METHOD("get_fit_report"), &DClothGarment::get_fit_report);
  BIND_ENUM_CONSTANT(FIT_BODY);
  BIND_ENUM_CONSTANT(FIT_BONES);
  BIND_ENUM_CONSTANT(FIT_NAMES);
  BIND_ENUM_CONSTANT(DETAIL_STATIC);
  BIND_ENUM_CONSTANT(DETAIL_SKELETON);
  BIND_ENUM_CONSTANT(DETAIL_MESH);
}
