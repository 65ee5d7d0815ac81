#include "converter/sequence.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstring>
#include <unordered_map>

#include "converter/bundle_metadata.h"
#include "converter/error.h"

namespace dcloth::converter {
namespace {

[[noreturn]] void Refuse(const SafeFile& file, const std::string& name, const std::string& found,
                         const std::string& expected) {
  throw Error({file.path(), name, found, expected, "see converter/BUNDLE.md, 'Sequences'"});
}

void ReadMatrices(const SafeFile& file, Sequence* sequence) {
  const SafeTensor& tensor = file.Require("joint_matrices");
  const uint64_t joints = sequence->joint_names.size();
  const Shape& shape = tensor.shape;
  if (shape.size() != 4 || shape[0] == 0 || shape[1] != joints || shape[2] != 4 || shape[3] != 4) {
    Refuse(file, tensor.name, "shape " + ShapeText(shape),
           "[T, " + std::to_string(joints) + ", 4, 4] with T of 1 or more");
  }
  if (tensor.type != SafeType::kF32) RefuseType(file, tensor, "F32");
  sequence->frame_count = static_cast<size_t>(shape[0]);
  sequence->joint_matrices = FloatsOf(file, tensor);
  for (size_t i = 0; i < sequence->frame_count * joints; ++i) {
    const float* const bottom = sequence->joint_matrices.data() + 16 * i + 12;
    // A product of float32 matrices may miss 0 0 0 1 by a few roundings; a transposed one misses it by metres.
    constexpr float kSlack = 1e-5f;
    if (std::abs(bottom[0]) > kSlack || std::abs(bottom[1]) > kSlack || std::abs(bottom[2]) > kSlack ||
        std::abs(bottom[3] - 1) > kSlack) {
      Refuse(file, tensor.name,
             "a last row other than 0 0 0 1 in frame " + std::to_string(i / joints) + ", joint '" +
                 sequence->joint_names[i % joints] + "'",
             "row-major matrices that act on column vectors");
    }
  }
}

void ReadWind(const SafeFile& file, Sequence* sequence) {
  const SafeTensor* const tensor = file.Find("wind");
  if (tensor == nullptr) return;
  const Shape expected = {sequence->frame_count, 3};
  if (tensor->shape != expected) Refuse(file, tensor->name, "shape " + ShapeText(tensor->shape), ShapeText(expected));
  if (tensor->type != SafeType::kF32) RefuseType(file, *tensor, "F32");
  sequence->wind = FloatsOf(file, *tensor);
  constexpr double kFastest = 100;  // as dcloth_cloth_set_wind allows
  for (size_t frame = 0; frame < sequence->frame_count; ++frame) {
    const auto [x, y, z] = sequence->FrameWind(frame);
    const double speed = std::hypot(double{x}, double{y}, double{z});
    if (speed > kFastest) {
      Refuse(file, tensor->name, NumberText(speed) + " m/s in frame " + std::to_string(frame), "at most 100 m/s");
    }
  }
}

void ReadTruth(const SafeFile& file, Sequence* sequence) {
  const SafeTensor* const tensor = file.Find("truth");
  if (tensor == nullptr) return;
  const Shape& shape = tensor->shape;
  if (shape.size() != 3 || shape[0] != sequence->frame_count || shape[1] == 0 || shape[2] != 3) {
    Refuse(file, tensor->name, "shape " + ShapeText(shape),
           std::string("[").append(std::to_string(sequence->frame_count)).append(", n, 3]"));
  }
  sequence->truth_vertex_count = static_cast<size_t>(shape[1]);
  sequence->truth = FloatsOf(file, *tensor);
  const SafeTensor* const origin = file.Find("truth_origin");
  if (origin == nullptr) {
    if (tensor->type == SafeType::kF16) Refuse(file, "truth", "F16 without truth_origin", "truth_origin [T, 3] F32");
    return;
  }
  const Shape expected = {shape[0], 3};
  if (origin->shape != expected) Refuse(file, origin->name, "shape " + ShapeText(origin->shape), ShapeText(expected));
  if (origin->type != SafeType::kF32) RefuseType(file, *origin, "F32");
  const std::vector<float> origins = FloatsOf(file, *origin);
  const size_t per_frame = sequence->truth_vertex_count * 3;
  for (size_t i = 0; i < sequence->truth.size(); ++i) {
    sequence->truth[i] += origins[i / per_frame * 3 + i % 3];
    if (!std::isfinite(sequence->truth[i])) {
      Refuse(file, origin->name, "a sum with truth that a float cannot hold at element " + std::to_string(i),
             "positions in metres");
    }
  }
}

}  // namespace

Sequence SequenceFrom(const SafeFile& file) {
  Sequence sequence;
  sequence.path = file.path();
  sequence.joint_names = UniqueNames(file, "joint_names");
  sequence.fps = PositiveNumber(file, "fps", 1000);
  if (const auto clip = file.metadata().find("clip"); clip != file.metadata().end()) sequence.clip = clip->second;
  ReadMatrices(file, &sequence);
  ReadWind(file, &sequence);
  ReadTruth(file, &sequence);
  return sequence;
}

Sequence ReadSequence(const std::filesystem::path& path) { return SequenceFrom(SafeFile::Read(path)); }

std::vector<uint32_t> MapJoints(const Sequence& sequence, std::span<const std::string> wanted) {
  std::unordered_map<std::string, uint32_t> index;
  for (size_t j = 0; j < sequence.joint_names.size(); ++j)
    index.emplace(sequence.joint_names[j], static_cast<uint32_t>(j));
  std::vector<uint32_t> map;
  std::string missing;
  for (const std::string& name : wanted) {
    const auto found = index.find(name);
    if (found == index.end()) {
      missing += (missing.empty() ? "" : ", ") + name;
    } else {
      map.push_back(found->second);
    }
  }
  if (!missing.empty()) {
    std::string held;
    for (const std::string& name : sequence.joint_names) held += (held.empty() ? "" : ", ") + name;
    throw Error({sequence.path, "", "no joints " + missing, "every joint of the model; the sequence has " + held,
                 "rename the sequence's joints or retarget it to the model's character"});
  }
  return map;
}

void GatherPose(const Sequence& sequence, size_t frame, std::span<const uint32_t> map, std::span<float> matrices) {
  const float* const source = sequence.joint_matrices.data() + frame * sequence.joint_names.size() * 16;
  for (size_t j = 0; j < map.size(); ++j) std::copy_n(source + size_t{map[j]} * 16, 16, matrices.data() + 16 * j);
}

void WriteRunOutput(const std::filesystem::path& path, const RunOutput& output) {
  const Shape shape = {output.frame_count, output.vertex_count, 3};
  const std::vector<int32_t> faces(output.triangles.begin(), output.triangles.end());
  const SafeTensor tensors[] = {{"positions", SafeType::kF32, shape, std::as_bytes(output.positions)},
                                {"faces", SafeType::kI32, {faces.size() / 3, 3}, std::as_bytes(std::span(faces))}};
  char fps[32];
  char* const end = std::to_chars(fps, fps + sizeof(fps), output.fps).ptr;
  WriteSafetensors(path, tensors,
                   {{"format", "dcloth-run"},
                    {"garment", output.garment},
                    {"fps", std::string(fps, static_cast<size_t>(end - fps))}});
}

}  // namespace dcloth::converter
