#include "tools/playback.h"

#include <cmath>
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

Player::Player(const converter::OpenModel& model, uint32_t stages, std::string source, uint32_t output_flags)
    : model_(model),
      stages_(stages),
      output_flags_(output_flags),
      source_(std::move(source)),
      positions_(size_t{model.info().vertex_count} * 3),
      normals_(positions_.size()) {
  if ((stages & ~model.info().stages) != 0) {
    throw converter::Error(
        {.path = {},
         .tensor = {},
         .found = std::string("stages '") + StagesName(stages) + "'",
         .expected = std::string("at most '") + StagesName(model.info().stages) + "', the last stage of the model",
         .mend = "choose an earlier stage with --stages, or convert a bundle that has this one"});
  }
}

void Player::Reset() { Check(dcloth_cloth_reset(model_.cloth()), "reset"); }

void Player::SetWind(const std::array<float, 3>& wind) {
  Check(dcloth_cloth_set_wind(model_.cloth(), wind.data(), nullptr), "set the wind");
}

void Player::Tick(std::span<const float> pose, dcloth_timer* timer) {
  const dcloth_pose p = Pose(pose);
  Check(dcloth_cloth_tick(model_.cloth(), &p, stages_, timer), "tick");
}

void Player::Skin(std::span<const float> pose, float blend, dcloth_timer* timer) {
  const dcloth_pose p = Pose(pose);
  const dcloth_output output = Output();
  Check(dcloth_cloth_skin(model_.cloth(), &p, blend, &output, timer), "skin");
}

void Player::Cool(std::span<const float> pose, CacheEvictor* evictor) const {
  evictor->Evict({model_.bytes(), model_.instance_memory(), std::as_bytes(pose), std::as_bytes(positions()),
                  std::as_bytes(normals())});
}

double Player::Update(std::span<const float> pose, float seconds, uint32_t flags, bool draw, dcloth_timer* timer) {
  const dcloth_pose p = Pose(pose);
  const dcloth_frame frame = {
      .struct_size = sizeof(frame), .stages = stages_, .seconds = seconds, .flags = flags, .error = nullptr};
  const dcloth_output output = Output();
  Check(dcloth_cloth_update(model_.cloth(), &p, &frame, draw ? &output : nullptr, timer), "update");
  dcloth_cloth_info info{};
  info.struct_size = sizeof(info);
  Check(dcloth_cloth_describe(model_.cloth(), &info), "describe");
  return static_cast<double>(info.tick_share);
}

dcloth_output Player::Output() {
  dcloth_output output{};
  output.struct_size = sizeof(output);
  output.vertex_count = model_.info().vertex_count;
  output.positions = positions_.data();
  output.position_stride_bytes = 3 * sizeof(float);
  output.normals = normals_.data();
  output.normal_stride_bytes = 3 * sizeof(float);
  output.flags = output_flags_;
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
