// One garment's frames on one instruction set, as a hash and as bytes to compare with those of another machine.
//
//   picture MODEL POSES --isa NAME [--write FILE] [--against FILE] [--body]
//
// POSES: f32 [frames, joints, 16] in the model's order of joints, the same bits for every machine. The frames come at
// one and a half times the tick rate; the first half plain, then pipelined, the last quarter plain.
// With --body all are kept outside of the body. FILE: f32 [frames, vertices, 3], world positions. Prints one
// line:
//   isa NAME frames N hash HEX worst_mm MM mean_mm MM frame_ms MM
// The hash covers positions and normals of every frame; worst_mm is the largest vertex distance to --against, mean_mm
// the largest mean of a frame, and frame_ms the median frame.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "tests/picture/played_model.h"

namespace {

using dcloth::testing::Fail;

// Vertex distances in mm; infinity where a position is not a number.
struct Distance {
  double largest = 0, mean = 0;
};

Distance Between(const std::vector<float>& a, const std::vector<float>& b) {
  Distance distance;
  for (size_t i = 0; i < a.size(); i += 3) {
    double square = 0;
    for (size_t c = 0; c < 3; ++c) square += std::pow(static_cast<double>(a[i + c]) - static_cast<double>(b[i + c]), 2);
    if (!(square >= 0)) return {HUGE_VAL, HUGE_VAL};
    distance.largest = std::max(distance.largest, 1000 * std::sqrt(square));
    distance.mean += 1000 * std::sqrt(square) / static_cast<double>(a.size() / 3);
  }
  return distance;
}

uint32_t FlagsOf(size_t frame, size_t frames) {
  if (frame < frames / 2) return 0;
  return frame < frames / 4 * 3 ? DCLOTH_FRAME_PIPELINED : 0;
}

struct Options {
  bool body = false;
  const char *model = nullptr, *poses = nullptr, *isa = nullptr, *write = nullptr, *against = nullptr;
};

Options Parse(int argc, char** argv) {
  Options options;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const char** value = word == "--isa"       ? &options.isa
                         : word == "--write"   ? &options.write
                         : word == "--against" ? &options.against
                                               : nullptr;
    if (word == "--body") {
      options.body = true;
    } else if (value != nullptr) {
      if (++i == argc) Fail(word + " without a value");
      *value = argv[i];
    } else {
      (options.model == nullptr ? options.model : options.poses) = argv[i];
    }
  }
  if (options.poses == nullptr || options.isa == nullptr) Fail("usage: picture MODEL POSES --isa NAME");
  return options;
}

std::FILE* Open(const char* path, const char* mode) {
  std::FILE* const file = path == nullptr ? nullptr : std::fopen(path, mode);
  if (path != nullptr && file == nullptr) Fail(std::string(path) + " cannot be opened");
  return file;
}

}  // namespace

int main(int argc, char** argv) {
  const Options options = Parse(argc, argv);
  if (dcloth_isa_select(options.isa) != DCLOTH_OK) Fail(std::string("this machine has no ") + options.isa);
  const dcloth::testing::PlayedModel played(options.model, options.poses);
  dcloth::testing::PlayedCloth player(played);
  dcloth::Cloth& cloth = player.cloth;
  const dcloth_model_info& info = played.info;
  const size_t frames = played.frames;
  std::FILE* const write = Open(options.write, "wb");
  std::FILE* const against = Open(options.against, "rb");
  std::vector<float> positions(3 * size_t{info.vertex_count}), normals(positions.size()), other(positions.size());
  std::vector<double> frame_ms;
  dcloth::testing::Hash hash;
  Distance worst;
  dcloth_output output = dcloth::MakeOutput(positions.data(), normals.data(), info.vertex_count);
  output.flags = options.body ? DCLOTH_OUTPUT_OUTSIDE_BODY : 0;
  for (size_t frame = 0; frame < frames; ++frame) {
    const dcloth_pose pose = played.Pose(frame);
    const dcloth_frame time = {sizeof(time), info.stages, info.tick_seconds / 1.5f, FlagsOf(frame, frames), nullptr};
    const auto start = std::chrono::steady_clock::now();
    if (cloth.Update(pose, time, &output) != dcloth::Status::kOk) Fail("a frame was refused");
    frame_ms.push_back(std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count());
    hash.Add(positions);
    hash.Add(normals);
    if (write != nullptr && std::fwrite(positions.data(), 4, positions.size(), write) != positions.size())
      Fail("the positions cannot be written");
    if (against != nullptr) {
      if (std::fread(other.data(), 4, other.size(), against) != other.size()) Fail("fewer frames to compare with");
      const Distance distance = Between(positions, other);
      worst = {std::max(worst.largest, distance.largest), std::max(worst.mean, distance.mean)};
    }
  }
  if (write != nullptr && std::fclose(write) != 0) Fail("the positions cannot be written");
  if (against != nullptr) std::fclose(against);
  std::nth_element(frame_ms.begin(), frame_ms.begin() + static_cast<std::ptrdiff_t>(frames / 2), frame_ms.end());
  std::printf("isa %s frames %zu hash %016llx worst_mm %.6f mean_mm %.6f frame_ms %.3f\n", dcloth_isa_name(), frames,
              hash.value(), worst.largest, worst.mean, frame_ms[frames / 2]);
  return 0;
}
