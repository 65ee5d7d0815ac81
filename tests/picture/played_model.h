// A model file and a track of poses for programs that run wherever the library does: no test framework, no file format
// beside the model's. What is wrong ends the program with 2 and a line on stderr.
#ifndef DCLOTH_TESTS_PICTURE_PLAYED_MODEL_H_
#define DCLOTH_TESTS_PICTURE_PLAYED_MODEL_H_

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

#include "dcloth/dcloth.hpp"
#include "tests/unit/engine/aligned_bytes.h"

namespace dcloth::testing {

[[noreturn]] inline void Fail(const std::string& what) {
  std::fprintf(stderr, "%s\n", what.c_str());
  std::exit(2);
}

inline AlignedBytes ReadWhole(const std::string& path) {
  std::FILE* const file = std::fopen(path.c_str(), "rb");
  if (file == nullptr) Fail(path + " cannot be read");
  std::fseek(file, 0, SEEK_END);
  AlignedBytes bytes(static_cast<size_t>(std::ftell(file)));
  std::fseek(file, 0, SEEK_SET);
  if (std::fread(bytes.data(), 1, bytes.size(), file) != bytes.size()) Fail(path + " ends too soon");
  std::fclose(file);
  return bytes;
}

// `poses`: f32 [frames, joints, 16] in the model's order of joints. Lives as long as its cloths.
struct PlayedModel {
  PlayedModel(const std::string& model_path, const std::string& poses_path)
      : bytes(ReadWhole(model_path)), poses(ReadWhole(poses_path)), view(Model::StorageSize()) {
    Error error;
    if (model.Open(bytes.data(), bytes.size(), view.data(), view.size(), &error) != Status::kOk) Fail(error.text);
    info = model.Describe();
    const size_t pose_bytes = size_t{64} * info.joint_count;
    frames = poses.size() / pose_bytes;
    if (frames == 0 || frames * pose_bytes != poses.size()) Fail(poses_path + " is of another skeleton");
  }
  PlayedModel(const PlayedModel&) = delete;

  dcloth_pose Pose(size_t frame) const {
    return MakePose(reinterpret_cast<const float*>(poses.data()) + frame * 16 * info.joint_count, info.joint_count);
  }

  AlignedBytes bytes, poses, view;
  Model model;
  dcloth_model_info info;
  size_t frames = 0;
};

struct PlayedCloth {
  explicit PlayedCloth(const PlayedModel& played) : memory(played.model.ClothStorageSize()) {
    Error error;
    if (cloth.Create(played.model, memory.data(), memory.size(), &error) != Status::kOk) Fail(error.text);
  }

  AlignedBytes memory;
  Cloth cloth;
};

// FNV-1a, 64 bits, over the floats' bytes.
class Hash {
 public:
  void Add(const std::vector<float>& values) {
    const auto* bytes = reinterpret_cast<const uint8_t*>(values.data());
    for (size_t i = 0; i < values.size() * sizeof(float); ++i) Add(bytes[i]);
  }
  void Add(uint8_t byte) { value_ = (value_ ^ byte) * 0x100000001B3u; }
  unsigned long long value() const { return value_; }

 private:
  uint64_t value_ = 0xCBF29CE484222325u;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_PICTURE_PLAYED_MODEL_H_
