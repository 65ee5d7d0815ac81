#include "tools/playback.h"

#include <Eigen/Core>  // half
#include <cmath>
#include <cstring>
#include <utility>

#include "converter/error.h"
#include "converter/file.h"
#include "converter/safetensors.h"

namespace dcloth::tools {

converter::OpenModel OpenModelFile(const std::filesystem::path& path) {
  converter::AlignedBytes bytes = converter::ReadFile(path);
  if (converter::LooksLikeSafetensors(bytes)) {
    throw converter::Error({.path = path,
                            .tensor = {},
                            .found = "a safetensors file",
                            .expected = "a .dcloth model",
                            .mend = "`dcloth convert BUNDLE -o MODEL` converts a training bundle to a model"});
  }
  return converter::OpenModel(std::move(bytes), path);
}

double TickRate(const converter::OpenModel& model) {
  // tick_seconds is a float: 1 / 30 comes back as 30.0000005. A rate is good to six digits.
  return std::round(1e4 / static_cast<double>(model.info().tick_seconds)) / 1e4;
}

namespace {

uint32_t DrawnVertices(const dcloth_model_info& info, const Drawn& drawn) {
  if ((drawn.flags & DCLOTH_OUTPUT_COARSE) != 0) return info.coarse_vertex_count;
  return (drawn.flags & DCLOTH_OUTPUT_TEXTURED) != 0 ? info.textured_vertex_count : info.vertex_count;
}

// Throws where the model has not what is to be drawn.
void CheckDrawn(const dcloth_model_info& info, const Drawn& drawn) {
  const auto refuse = [](const char* what, const char* mend) {
    throw converter::Error({.path = {},
                            .tensor = {},
                            .found = std::string(what) + ", and a model without them",
                            .expected = "a model that holds them",
                            .mend = mend});
  };
  if ((drawn.flags & DCLOTH_OUTPUT_COARSE) != 0 && info.coarse_vertex_count == 0)
    refuse("vertices of the coarse mesh to draw", "convert the bundle again");
  if (((drawn.flags & DCLOTH_OUTPUT_TEXTURED) != 0 || drawn.tangents) && info.texture_coordinates == nullptr)
    refuse("texture coordinates to draw by", "convert a bundle that has template.texture_coordinates");
}

}  // namespace

Player::Player(const converter::OpenModel& model, uint32_t stages, std::string source, const Drawn& drawn,
               dcloth_cloth* cloth)
    : model_(model),
      cloth_(cloth != nullptr ? cloth : model.cloth()),
      stages_(stages),
      drawn_(drawn),
      source_(std::move(source)) {
  CheckDrawn(model.info(), drawn);
  if ((stages & ~model.info().stages) != 0) {
    throw converter::Error(
        {.path = {},
         .tensor = {},
         .found = std::string("stages '") + StagesName(stages) + "'",
         .expected = std::string("at most '") + StagesName(model.info().stages) + "', the last stage of the model",
         .mend = "choose an earlier stage with --stages, or convert a bundle that has this one"});
  }
  Ask(stages, drawn);
}

void Player::Ask(uint32_t stages, const Drawn& drawn) {
  stages_ = stages;
  drawn_ = drawn;
  vertex_count_ = DrawnVertices(model_.info(), drawn);
  positions_.resize(size_t{3} * vertex_count_);
  normals_.resize(drawn.normals ? positions_.size() : 0);
  tangents_.resize(drawn.tangents ? size_t{4} * vertex_count_ : 0);
  const dcloth_output output = Output();
  scratch_.resize(dcloth_output_scratch_size(&output));
}

void Player::Reset() { Check(dcloth_cloth_reset(cloth_), "reset"); }

void Player::SetWind(const std::array<float, 3>& wind) {
  Check(dcloth_cloth_set_wind(cloth_, wind.data(), nullptr), "set the wind");
}

void Player::Tick(std::span<const float> pose, dcloth_timer* timer) {
  const dcloth_pose p = Pose(pose);
  Check(dcloth_cloth_tick(cloth_, &p, stages_, timer), "tick");
}

void Player::Skin(std::span<const float> pose, float blend, dcloth_timer* timer) {
  const dcloth_pose p = Pose(pose);
  const dcloth_output output = Output();
  Check(dcloth_cloth_skin(cloth_, &p, blend, &output, timer), "skin");
}

void Player::Cool(std::span<const float> pose, CacheEvictor* evictor) const {
  evictor->Evict({model_.bytes(), model_.instance_memory(), std::as_bytes(pose), std::as_bytes(positions()),
                  std::as_bytes(normals()), std::as_bytes(std::span(tangents_)), std::span(scratch_)});
}

double Player::Update(std::span<const float> pose, float seconds, uint32_t flags, bool draw, dcloth_timer* timer) {
  const dcloth_pose p = Pose(pose);
  const dcloth_frame frame = {
      .struct_size = sizeof(frame), .stages = stages_, .seconds = seconds, .flags = flags, .error = nullptr};
  const dcloth_output output = Output();
  Check(dcloth_cloth_update(cloth_, &p, &frame, draw ? &output : nullptr, timer), "update");
  dcloth_cloth_info info{};
  info.struct_size = sizeof(info);
  Check(dcloth_cloth_describe(cloth_, &info), "describe");
  return static_cast<double>(info.tick_share);
}

std::vector<float> Player::ReadPositions() const {
  std::vector<float> out = positions_;
  for (size_t i = 0; i < out.size() && drawn_.half; ++i) {
    Eigen::half half;
    std::memcpy(&half, reinterpret_cast<const std::byte*>(positions_.data()) + i * sizeof(half), sizeof(half));
    out[i] = static_cast<float>(half);
  }
  return out;
}

dcloth_output Player::Output() {
  const uint32_t format = drawn_.half ? uint32_t{DCLOTH_FORMAT_FLOAT16} : uint32_t{DCLOTH_FORMAT_FLOAT32};
  const auto number = static_cast<uint32_t>(drawn_.half ? sizeof(uint16_t) : sizeof(float));
  dcloth_output output{};
  output.struct_size = sizeof(output);
  output.vertex_count = vertex_count_;
  output.positions = positions_.data();
  output.position_stride_bytes = 3 * number;
  output.position_format = format;
  if (drawn_.normals) output.normals = normals_.data();
  output.normal_stride_bytes = 3 * number;
  output.normal_format = format;
  if (drawn_.tangents) output.tangents = tangents_.data();
  output.tangent_stride_bytes = 4 * number;
  output.tangent_format = format;
  output.texture_coordinates = model_.info().texture_coordinates;
  output.texture_stride_bytes = 2 * sizeof(float);
  output.flags = drawn_.flags;
  output.scratch = scratch_.data();
  output.scratch_size = scratch_.size();
  return output;
}

dcloth_pose Player::Pose(std::span<const float> matrices) const {
  return {.struct_size = sizeof(dcloth_pose),
          .joint_count = static_cast<uint32_t>(matrices.size() / 16),
          .joint_matrices = matrices.data(),
          .column_major = 0,
          .padding = 0};
}

void Player::Check(dcloth_status status, const char* what) const {
  if (status == DCLOTH_OK) return;
  throw converter::Error(
      {.path = source_,
       .tensor = "joint_matrices",
       .found = std::string("an error of the engine (") + what + ": " + dcloth_status_name(status) + ")",
       .expected = "finite poses of " + std::to_string(model_.info().joint_count) + " joints",
       .mend = "look for NaN, infinity or collapsed joints in the sequence"});
}

}  // namespace dcloth::tools
