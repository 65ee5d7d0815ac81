// Sequences: a character's joint matrices frame by frame, and the cloth's true positions where known. BUNDLE.md.
#ifndef DCLOTH_CONVERTER_SEQUENCE_H_
#define DCLOTH_CONVERTER_SEQUENCE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "converter/safetensors.h"

namespace dcloth::converter {

struct Sequence {
  std::filesystem::path path;
  std::vector<std::string> joint_names;
  double fps = 0;
  std::string clip;  // what the motion is called, "mocap/run"; empty where the file does not say
  size_t frame_count = 0;
  std::vector<float> joint_matrices;  // [frame_count, joints, 4, 4] world, rows contiguous
  size_t truth_vertex_count = 0;      // 0 without truth
  std::vector<float> wind;            // [frame_count, 3] world, m/s; empty: calm
  std::vector<float> truth;           // [frame_count, truth_vertex_count, 3] world, metres; empty without truth

  // Zero without wind.
  std::array<float, 3> FrameWind(size_t frame) const {
    if (wind.empty()) return {};
    return {wind[3 * frame], wind[3 * frame + 1], wind[3 * frame + 2]};
  }
  // Motion out of a generator, which training may have seen: never averaged with recorded motion.
  bool scripted() const { return clip.starts_with("procedural/"); }
  bool has_truth() const { return truth_vertex_count != 0; }
  std::span<const float> FrameTruth(size_t frame) const {
    return std::span(truth).subspan(frame * truth_vertex_count * 3, truth_vertex_count * 3);
  }
};

// Throws Error: shapes, dtypes, NaN or infinity, a wind over 100 m/s, a bottom row other than 0 0 0 1 (a transposed
// matrix), duplicate joint names, fps outside (0, 1000], no frames.
Sequence ReadSequence(const std::filesystem::path& path);
Sequence SequenceFrom(const SafeFile& file);

// For each wanted joint its index in the sequence; throws Error with all the missing ones.
std::vector<uint32_t> MapJoints(const Sequence& sequence, std::span<const std::string> wanted);

// Copies one frame's matrices in the order of `map` to `matrices` [map.size(), 16].
void GatherPose(const Sequence& sequence, size_t frame, std::span<const uint32_t> map, std::span<float> matrices);

// What `dcloth run` writes: tensors `positions` [T, n, 3], `faces` [c, 3] I32; metadata format "dcloth-run", fps,
// garment.
struct RunOutput {
  std::string garment;
  double fps = 0;
  size_t frame_count = 0;
  size_t vertex_count = 0;
  std::span<const float> positions;     // [frame_count, vertex_count, 3] world, metres
  std::span<const uint16_t> triangles;  // [c, 3]
};

// Writes atomically. Throws Error.
void WriteRunOutput(const std::filesystem::path& path, const RunOutput& output);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_SEQUENCE_H_
