#include "garment/garment.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace dcloth::platforms {
namespace {

dcloth_error EmptyError() {
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  return error;
}

bool Done(dcloth_status status, const dcloth_error& error, std::string* text) {
  if (status != DCLOTH_OK && text != nullptr) *text = error.text;
  return status == DCLOTH_OK;
}

}  // namespace

GarmentModel::GarmentModel(size_t size) : bytes_(size), view_(dcloth_model_storage_size()) {}

std::shared_ptr<const GarmentModel> GarmentModel::Open(const void* bytes, size_t size, std::string* error) {
  std::shared_ptr<GarmentModel> model(new GarmentModel(size));
  if (size != 0) std::memcpy(model->bytes_.data(), bytes, size);
  dcloth_error why = EmptyError();
  const dcloth_status status =
      dcloth_model_open(model->bytes_.data(), size, model->view_.data(), model->view_.size(), &model->model_, &why);
  if (!Done(status, why, error)) return nullptr;
  model->info_.struct_size = sizeof(model->info_);
  (void)dcloth_model_describe(model->model_, &model->info_);
  return model;
}

std::vector<int32_t> GarmentModel::Triangles(Front front) const {
  const uint16_t* const from = is_textured() ? info_.textured_triangles : info_.triangles;
  std::vector<int32_t> corners(from, from + 3 * size_t{info_.triangle_count});
  if (front == Front::kClockwise) {
    for (size_t i = 0; i < corners.size(); i += 3) std::swap(corners[i + 1], corners[i + 2]);
  }
  return corners;
}

void Wearer::AddJoint(std::string name, const double bind[16]) {
  joint_names.push_back(std::move(name));
  for (int i = 0; i < 16; ++i) bind_matrices.push_back(static_cast<float>(bind[i]));
}

void Wearer::AddBodyVertex(const double position[3], const uint32_t* joints, const float* weights, size_t count) {
  for (int i = 0; i < 3; ++i) body_positions.push_back(static_cast<float>(position[i]));
  for (size_t i = 0; i < kInfluences; ++i) {
    body_joints.push_back(i < count ? joints[i] : 0);
    body_weights.push_back(i < count ? weights[i] : 0);
  }
}

Garment::Garment(std::shared_ptr<const GarmentModel> model, size_t joint_count)
    : model_(std::move(model)),
      memory_(dcloth_cloth_storage_size(model_->get())),
      matrices_(16 * joint_count),
      positions_(3 * size_t{model_->vertex_count()}),
      normals_(positions_.size()) {
  for (size_t i = 0; i < matrices_.size(); ++i) matrices_[i] = i % 16 % 5 == 0 ? 1.0f : 0.0f;
}

std::unique_ptr<Garment> Garment::Create(std::shared_ptr<const GarmentModel> model, const dcloth_space& space,
                                         const Wearer& wearer, Match match, std::string* error) {
  std::unique_ptr<Garment> garment(new Garment(std::move(model), wearer.joint_names.size()));
  dcloth_error why = EmptyError();
  dcloth_status status = dcloth_cloth_create(garment->model_->get(), garment->memory_.data(), garment->memory_.size(),
                                             &garment->cloth_, &why);
  if (status == DCLOTH_OK) status = dcloth_cloth_set_space(garment->cloth_, &space, &why);
  if (status == DCLOTH_OK) status = garment->Wear(wearer, match, &why);
  return Done(status, why, error) ? std::move(garment) : nullptr;
}

dcloth_status Garment::Wear(const Wearer& wearer, Match match, dcloth_error* error) {
  std::vector<const char*> names;
  for (const std::string& name : wearer.joint_names) names.push_back(name.c_str());
  const uint32_t count = static_cast<uint32_t>(names.size());
  if (match == Match::kNames) return dcloth_cloth_bind_joints(cloth_, names.data(), count, error);

  dcloth_character character = {};
  character.struct_size = sizeof(character);
  character.joint_count = count;
  character.joint_names = names.data();
  character.bind_matrices = wearer.bind_matrices.data();
  character.column_major = 1;
  if (match == Match::kBody && wearer.body_vertex_count() != 0) {
    character.body_vertex_count = wearer.body_vertex_count();
    character.body_positions = wearer.body_positions.data();
    character.body_joints = wearer.body_joints.data();
    character.body_weights = wearer.body_weights.data();
    character.body_influences = Wearer::kInfluences;
    character.body_triangle_count = static_cast<uint32_t>(wearer.body_triangles.size() / 3);
    character.body_triangles = character.body_triangle_count != 0 ? wearer.body_triangles.data() : nullptr;
    fit_memory_ = std::make_unique<LentMemory>(dcloth_fit_storage_size(model_->get(), &character));
  }
  dcloth_fit fit = {};
  fit.struct_size = sizeof(fit);
  const dcloth_status status =
      dcloth_cloth_fit(cloth_, &character, fit_memory_ != nullptr ? fit_memory_->data() : nullptr,
                       fit_memory_ != nullptr ? fit_memory_->size() : 0, &fit, error);
  if (status == DCLOTH_OK) fit_ = fit;
  return status;
}

bool Garment::Follow(const double place[3], double reach) {
  double away = 0;
  for (int i = 0; i < 3; ++i) {
    if (!std::isfinite(place[i])) return false;  // Update will refuse the joints
    away = std::max(away, std::abs(place[i] - origin_[i]));
  }
  if (followed_ && away <= reach) return false;
  jumped_ = jumped_ || followed_;
  followed_ = true;
  std::copy(place, place + 3, origin_);
  return true;
}

void Garment::SetJoint(size_t joint, const double matrix[16]) {
  float* const to = &matrices_[16 * joint];
  for (int i = 0; i < 16; ++i) to[i] = static_cast<float>(i >= 12 && i < 15 ? matrix[i] - origin_[i - 12] : matrix[i]);
}

bool Garment::Update(const GarmentFrame& frame, std::string* error) {
  dcloth_error why = EmptyError();
  const dcloth_pose pose = {sizeof(pose), static_cast<uint32_t>(joint_count()), matrices_.data(), 1, 0};
  dcloth_frame step = {sizeof(step), frame.stages, frame.seconds, 0, &why};
  if (frame.pipelined) step.flags |= DCLOTH_FRAME_PIPELINED;
  if (frame.half_rate_mesh) step.flags |= DCLOTH_FRAME_HALF_RATE_MESH;
  if (frame.freeze_idle) step.flags |= DCLOTH_FRAME_FREEZE_IDLE;
  if (jumped_) step.flags |= DCLOTH_FRAME_JUMPED;
  dcloth_output output = {};
  output.struct_size = sizeof(output);
  output.vertex_count = model_->vertex_count();
  output.positions = positions_.data();
  output.normals = normals_.data();
  output.position_stride_bytes = output.normal_stride_bytes = 3 * sizeof(float);
  output.bounds = bounds_;
  if (frame.outside_body) output.flags |= DCLOTH_OUTPUT_OUTSIDE_BODY;
  if (model_->is_textured()) output.flags |= DCLOTH_OUTPUT_TEXTURED;
  const dcloth_status status = dcloth_cloth_update(cloth_, &pose, &step, frame.draw ? &output : nullptr, nullptr);
  if (!Done(status, why, error)) return false;
  jumped_ = false;
  return true;
}

bool Garment::SetWind(const float wind[3], std::string* error) {
  dcloth_error why = EmptyError();
  return Done(dcloth_cloth_set_wind(cloth_, wind, &why), why, error);
}

void Garment::Reset() {
  (void)dcloth_cloth_reset(cloth_);
  jumped_ = false;
}

}  // namespace dcloth::platforms
