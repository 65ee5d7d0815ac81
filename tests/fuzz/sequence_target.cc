#include <cstring>

#include "converter/error.h"
#include "converter/sequence.h"
#include "tests/fuzz/targets.h"
#include "tests/unit/engine/all_finite.h"

namespace dcloth::testing {

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

}  // namespace dcloth::testing
