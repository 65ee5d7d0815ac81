#include "converter/rollout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "converter/error.h"
#include "converter/foreign_file.h"

namespace dcloth::converter {
namespace {

void Require(dcloth_status status, const std::filesystem::path& path, const std::string& what) {
  if (status != DCLOTH_OK)
    throw Error({path, "", "a failure of " + what + ": " + dcloth_status_name(status), "",
                 "look for NaN, infinity or collapsed joints in the file"});
}

dcloth_error EmptyError() {
  dcloth_error error{};
  error.struct_size = sizeof(error);
  return error;
}

// The engine's error in an Error's words.
ErrorParts PartsOf(const dcloth_error& error, const std::filesystem::path& path) {
  const auto part = [&error](uint16_t at, uint16_t size) { return std::string(error.text + at, size); };
  if (error.found_size == 0) return {path, "", error.text, "", ""};
  ErrorParts parts;
  parts.path = path;
  parts.found = part(error.found_at, error.found_size);
  if (error.what_size != 0) parts.found.append(" in ").append(part(error.what_at, error.what_size));
  if (error.offset_bytes != UINT64_MAX) parts.found.append(" at byte ").append(std::to_string(error.offset_bytes));
  parts.expected = part(error.allowed_at, error.allowed_size);
  parts.mend = part(error.mend_at, error.mend_size);
  return parts;
}

}  // namespace

OpenModel::OpenModel(AlignedBytes bytes, std::filesystem::path path)
    : bytes_(std::move(bytes)), model_memory_(dcloth_model_storage_size()) {
  dcloth_error error = EmptyError();
  // An empty file has no bytes to point to: any address does for none.
  const std::byte* const start = bytes_.empty() ? model_memory_.data() : bytes_.data();
  if (dcloth_model_open(start, bytes_.size(), model_memory_.data(), model_memory_.size(), &model_, &error) !=
      DCLOTH_OK) {
    if (const ForeignFile foreign = ForeignFileOf(bytes_); foreign.name != nullptr) {
      throw Error({path, "", foreign.name, "a .dcloth model", foreign.mend});
    }
    throw Error(PartsOf(error, path));
  }
  info_.struct_size = sizeof(info_);
  Require(dcloth_model_describe(model_, &info_), path, "dcloth_model_describe");
  for (uint32_t j = 0; j < info_.joint_count; ++j) joint_names_.emplace_back(dcloth_model_joint_name(model_, j));
  cloth_memory_.resize(dcloth_cloth_storage_size(model_));
  error = EmptyError();
  if (dcloth_cloth_create(model_, cloth_memory_.data(), cloth_memory_.size(), &cloth_, &error) != DCLOTH_OK) {
    throw Error(PartsOf(error, path));
  }
}

void Rollout(const OpenModel& model, const Sequence& sequence, uint32_t stages, const FrameVisitor& visit,
             dcloth_timer* timer) {
  const dcloth_model_info& info = model.info();
  const double tick_rate = 1 / static_cast<double>(info.tick_seconds);
  if (std::abs(sequence.fps - tick_rate) > 0.01 * tick_rate) {
    throw Error({sequence.path, "", NumberText(sequence.fps) + " frames a second",
                 NumberText(tick_rate) + ", the model's tick rate", "resample the sequence"});
  }
  const std::vector<uint32_t> map = MapJoints(sequence, model.joint_names());
  std::vector<float> matrices(map.size() * 16), positions(size_t{info.vertex_count} * 3), normals(positions.size());
  const dcloth_pose pose = {sizeof(dcloth_pose), info.joint_count, matrices.data(), 0, 0};
  dcloth_output output{};
  output.struct_size = sizeof(output);
  output.vertex_count = info.vertex_count;
  output.positions = positions.data();
  output.normals = normals.data();
  output.position_stride_bytes = output.normal_stride_bytes = 3 * sizeof(float);
  Require(dcloth_cloth_reset(model.cloth()), sequence.path, "dcloth_cloth_reset");
  for (size_t frame = 0; frame < sequence.frame_count; ++frame) {
    GatherPose(sequence, frame, map, matrices);
    const std::string at = " of frame " + std::to_string(frame);
    const std::array<float, 3> wind = sequence.FrameWind(frame);
    Require(dcloth_cloth_set_wind(model.cloth(), wind.data(), nullptr), sequence.path, "the wind" + at);
    Require(dcloth_cloth_tick(model.cloth(), &pose, stages, timer), sequence.path, "the tick" + at);
    Require(dcloth_cloth_skin(model.cloth(), &pose, 1.0f, &output, timer), sequence.path, "skinning" + at);
    visit(frame, positions, normals);
  }
}

MeshError CompareModels(const OpenModel& model, const OpenModel& reference, std::span<const Sequence> sequences) {
  ErrorMeter meter(reference.triangles(), reference.info().vertex_count);
  for (const Sequence& sequence : sequences) {
    std::vector<float> expected;
    const auto keep = [&](size_t, std::span<const float> positions, std::span<const float>) {
      expected.insert(expected.end(), positions.begin(), positions.end());
    };
    Rollout(reference, sequence, reference.info().stages, keep);
    const auto compare = [&](size_t frame, std::span<const float> positions, std::span<const float>) {
      const size_t size = size_t{reference.info().vertex_count} * 3;
      meter.AddFrame(positions, std::span<const float>(expected).subspan(frame * size, size));
    };
    Rollout(model, sequence, model.info().stages, compare);
  }
  return meter.Result();
}

}  // namespace dcloth::converter
