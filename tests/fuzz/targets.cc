// Readers of untrusted bytes, and what happens next to what they take. Saved states and scenes have files of their own.
#include "tests/fuzz/targets.h"

#include <cstring>
#include <span>

#include "converter/convert.h"
#include "converter/error.h"
#include "converter/sequence.h"
#include "engine/format/checksum.h"
#include "tests/attack/open_and_run.h"
#include "tests/fuzz/character_use.h"
#include "tests/unit/engine/aligned_bytes.h"
#include "tests/unit/engine/all_finite.h"
#include "tools/character/gltf_model.h"
#include "tools/character/gltf_reader.h"

namespace dcloth::testing {

Verdict FuzzModel(const uint8_t* bytes, size_t size) {
  constexpr size_t kStorageLimit = 64 << 20;  // larger garments only cost time
  AlignedBytes file((size + 63) / 64 * 64);
  std::memset(file.data(), 0, file.size());
  if (size != 0) std::memcpy(file.data(), bytes, size);
  const ChosenIsa isa(format::Checksum(bytes, size) >> 32);
  const Outcome outcome = OpenAndRun(file.data(), file.size(), kStorageLimit);
  return {outcome.broken_promise, outcome.status == DCLOTH_OK};
}

Verdict FuzzBundle(const uint8_t* bytes, size_t size) {
  converter::AlignedBytes file(size);
  if (size != 0) std::memcpy(file.data(), bytes, size);
  converter::AlignedBytes model;
  try {
    const converter::Bundle bundle = converter::BundleFrom(converter::SafeFile::Parse(std::move(file), "bundle"));
    converter::ConvertOptions options;
    options.precision = converter::Precision::kInt8;
    model = converter::Convert(bundle, options).bytes;
  } catch (const converter::Error& error) {
    return {*error.what() != '\0' ? "" : "a refusal without a word", false};
  }
  const Outcome outcome = OpenAndRun(model.data(), model.size());
  if (outcome.status != DCLOTH_OK) return {"a converted model that does not open: " + outcome.text, false};
  return {outcome.broken_promise, true};
}

Verdict FuzzSequence(const uint8_t* bytes, size_t size) {
  converter::AlignedBytes file(size);
  if (size != 0) std::memcpy(file.data(), bytes, size);
  try {
    const converter::SafeFile parsed = converter::SafeFile::Parse(std::move(file), "sequence");
    const converter::Sequence sequence = converter::SequenceFrom(parsed);
    if (sequence.frame_count == 0 || !(sequence.fps > 0)) return {"a sequence without frames or time", false};
    std::vector<std::string> backwards(sequence.joint_names.rbegin(), sequence.joint_names.rend());
    const std::vector<uint32_t> map = converter::MapJoints(sequence, backwards);
    std::vector<float> pose(16 * map.size());
    for (size_t frame = 0; frame < sequence.frame_count; ++frame) {
      converter::GatherPose(sequence, frame, map, pose);
      if (!AllFinite(pose)) return {"a pose that is not finite", false};
      if (sequence.has_truth() && sequence.FrameTruth(frame).size() != 3 * sequence.truth_vertex_count)
        return {"a truth of the wrong size", false};
    }
    if (!AllFinite(sequence.truth)) return {"a truth that is not finite", false};
  } catch (const converter::Error& error) {
    return {*error.what() != '\0' ? "" : "a refusal without a word", false};
  }
  return {"", true};
}

Verdict FuzzGltf(const uint8_t* bytes, size_t size) {
  const std::filesystem::path path = "nowhere/file.glb";
  tools::Folder folder(path.parent_path(), nullptr);  // is not there, so nothing in it is read
  return ReadAndUse(
      [&] {
        const tinygltf::Model model = tools::ReadGltfModel(path, std::as_bytes(std::span(bytes, size)), &folder);
        return tools::GltfReader(path, model, &folder).Read(true);
      },
      {});
}

}  // namespace dcloth::testing
