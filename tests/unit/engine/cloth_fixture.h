// A model and a cloth behind the C ABI, in memory of exactly the size they ask for.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_CLOTH_FIXTURE_H_
#define DCLOTH_TESTS_UNIT_ENGINE_CLOTH_FIXTURE_H_

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "dcloth/dcloth.hpp"
#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

inline dcloth_error EmptyError() {
  dcloth_error error = {};
  error.struct_size = sizeof(error);
  return error;
}

// Float positions and normals (null when not wanted) at one stride.
inline dcloth_output FloatOutput(size_t vertex_count, float* positions, uint32_t stride_bytes, float* normals) {
  dcloth_output output = MakeOutput(positions, normals, static_cast<uint32_t>(vertex_count));
  output.position_stride_bytes = output.normal_stride_bytes = stride_bytes;
  return output;
}

class OpenedModel {
 public:
  explicit OpenedModel(AlignedBytes bytes)
      : bytes_(std::move(bytes)), storage_(dcloth_model_storage_size()), error_(EmptyError()) {
    status_ = dcloth_model_open(bytes_.data(), bytes_.size(), storage_.data(), storage_.size(), &model_, &error_);
  }
  explicit OpenedModel(const TestModel& model) : OpenedModel(model.Bytes()) {}

  dcloth_status status() const { return status_; }
  const dcloth_error& error() const { return error_; }
  const dcloth_model* get() const { return model_; }
  const AlignedBytes& bytes() const { return bytes_; }
  dcloth_model_info info() const {
    dcloth_model_info info = {};
    info.struct_size = sizeof(info);
    dcloth_model_describe(model_, &info);
    return info;
  }

 private:
  AlignedBytes bytes_, storage_;
  dcloth_error error_;
  dcloth_model* model_ = nullptr;
  dcloth_status status_;
};

class OwnedCloth {
 public:
  explicit OwnedCloth(const OpenedModel& model)
      : model_(model),
        storage_(dcloth_cloth_storage_size(model.get())),
        positions_(3 * size_t{model.info().vertex_count}),
        normals_(positions_.size()) {
    dcloth_error error = EmptyError();
    EXPECT_EQ(dcloth_cloth_create(model.get(), storage_.data(), storage_.size(), &cloth_, &error), DCLOTH_OK)
        << error.text;
  }

  dcloth_cloth* get() { return cloth_; }
  const AlignedBytes& storage() const { return storage_; }
  const std::vector<float>& positions() const { return positions_; }
  const std::vector<float>& normals() const { return normals_; }

  static dcloth_pose Pose(const std::vector<float>& matrices) {
    return {sizeof(dcloth_pose), static_cast<uint32_t>(matrices.size() / 16), matrices.data(), 0, 0};
  }
  dcloth_status Tick(const std::vector<float>& matrices, uint32_t stages) {
    const dcloth_pose pose = Pose(matrices);
    return dcloth_cloth_tick(cloth_, &pose, stages, nullptr);
  }
  // A frame drawn into positions() and normals().
  dcloth_status Update(const std::vector<float>& matrices, float seconds, uint32_t stages, uint32_t flags = 0) {
    const dcloth_pose pose = Pose(matrices);
    const dcloth_frame frame = {sizeof(dcloth_frame), stages, seconds, flags, nullptr};
    const dcloth_output output = Output();
    return dcloth_cloth_update(cloth_, &pose, &frame, &output, nullptr);
  }
  dcloth_status Skin(const std::vector<float>& matrices, float blend) {
    const dcloth_pose pose = Pose(matrices);
    const dcloth_output output = Output();
    return dcloth_cloth_skin(cloth_, &pose, blend, &output, nullptr);
  }

 private:
  dcloth_output Output() { return MakeOutput(positions_.data(), normals_.data(), model_.info().vertex_count); }

  const OpenedModel& model_;
  AlignedBytes storage_;
  dcloth_cloth* cloth_ = nullptr;
  std::vector<float> positions_, normals_;
};

// Names that dcloth_isa_select takes on this machine.
inline std::vector<std::string> UsableIsas() {
  std::vector<std::string> names;
  for (const char* name : {"scalar", "sse4", "avx2", "avx3", "neon", "wasm", "reproducible"}) {
    if (dcloth_isa_select(name) == DCLOTH_OK) names.emplace_back(name);
  }
  dcloth_isa_select(nullptr);
  return names;
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_CLOTH_FIXTURE_H_
