// What a model's tick and frame must compute and move: counted from its sizes, not measured.
#ifndef DCLOTH_CONVERTER_MODEL_WORK_H_
#define DCLOTH_CONVERTER_MODEL_WORK_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "engine/format/tick_parts.h"

namespace dcloth::converter {

// The pieces of a frame, in the engine's order: the parts of a tick, then what every drawn frame runs.
#define DCLOTH_PART(part, number, name, step) k##part,
enum class WorkPart : uint8_t { DCLOTH_TICK_PARTS(DCLOTH_PART) kSkinning, kNormals };
#undef DCLOTH_PART
constexpr size_t kWorkPartCount = format::kTickPartCount + 2;

struct PartWork {
  uint64_t flops = 0;         // floating or integer; a multiply-add is two
  uint64_t weight_bytes = 0;  // of the model, read once
  uint64_t state_bytes = 0;   // of the instance and the host's buffers, read and written; a gathered row counts once
  bool int8 = false;          // multiplies in 16-bit integers: twice as many to an instruction as float32

  uint64_t bytes() const { return weight_bytes + state_bytes; }
};
using ModelWork = std::array<PartWork, kWorkPartCount>;

const char* WorkPartName(WorkPart part);  // "skeleton input", "basis"
// The piece with this name, as a dcloth_timer is told it; false for the others ("pose", "penetration").
bool FindWorkPart(std::string_view name, WorkPart* part);
// The DCLOTH_STEP_* under which the engine's timer counts it.
int StepOf(WorkPart part);

// All stages, positions and normals written tightly. Zero for what the model lacks. `model` has been opened once:
// nothing is verified here. Counts per element are in the source, each with what it counts.
ModelWork CountWork(std::span<const std::byte> model);

// Of a patch stage; zeros where the model has none.
struct PatchSizes {
  uint32_t patches = 0, points = 0;  // points a patch
  uint32_t width = 0;                // features
  uint32_t sources = 0;              // points that a vertex follows
};
PatchSizes PatchSizesOf(std::span<const std::byte> model);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_MODEL_WORK_H_
