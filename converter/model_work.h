// What a model's tick and frame must compute and move: counted from its sizes, not measured.
#ifndef DCLOTH_CONVERTER_MODEL_WORK_H_
#define DCLOTH_CONVERTER_MODEL_WORK_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

namespace dcloth::converter {

// The pieces of a frame, in the engine's order; each is one kernel, called once or once a layer.
enum class WorkPart : uint8_t {
  kStatic,            // pivot increments: two products
  kSkeletonInput,     // the GRU's products
  kSkeletonHidden,
  kSkeletonGates,
  kBodyPoints,        // the mesh stage's input: posed body points
  kMeshLayers,        // GSGRU layers with LayerNorm, PReLU and the embedding
  kMeshHidden,        // vertex perceptron, n -> h
  kMeshCoefficients,  // h -> coefficients
  kHead,              // P through the head of a reduced basis
  kBasis,             // the displacement: coefficients times basis
  kSkinning,          // every drawn frame, as normals
  kNormals,
};
constexpr size_t kWorkPartCount = 12;

struct PartWork {
  uint64_t flops = 0;         // floating or integer; a multiply-add is two
  uint64_t weight_bytes = 0;  // of the model, read once
  uint64_t state_bytes = 0;   // of the instance and the host's buffers, read and written; a gathered row counts once
  bool int8 = false;          // multiplies in 16-bit integers: twice as many to an instruction as float32

  uint64_t bytes() const { return weight_bytes + state_bytes; }
};
using ModelWork = std::array<PartWork, kWorkPartCount>;

const char* WorkPartName(WorkPart part);  // "skeleton input", "basis"
// The DCLOTH_STEP_* under which the engine's timer counts it.
int StepOf(WorkPart part);

// All stages, positions and normals written tightly. Zero for what the model lacks. `model` has been opened once:
// nothing is verified here. Counts per element are in the source, each with what it counts.
ModelWork CountWork(std::span<const std::byte> model);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_MODEL_WORK_H_
