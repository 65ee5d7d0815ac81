// Runs a model over a sequence through the C ABI, one tick a frame: what a host does, offline.
#ifndef DCLOTH_CONVERTER_ROLLOUT_H_
#define DCLOTH_CONVERTER_ROLLOUT_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "converter/file.h"
#include "converter/metrics.h"
#include "converter/sequence.h"
#include "dcloth/dcloth.h"

namespace dcloth::converter {

// A model and one cloth in memory of their own. Not copyable: the engine keeps pointers into both.
class OpenModel {
 public:
  // Throws Error with the engine's text; `path` only names the source in errors.
  explicit OpenModel(AlignedBytes bytes, std::filesystem::path path = {});
  OpenModel(OpenModel&&) = default;

  const dcloth_model* model() const { return model_; }
  const dcloth_model_info& info() const { return info_; }
  const std::vector<std::string>& joint_names() const { return joint_names_; }
  std::span<const std::byte> bytes() const { return bytes_; }
  std::span<const uint16_t> triangles() const { return {info_.triangles, size_t{info_.triangle_count} * 3}; }
  size_t instance_bytes() const { return cloth_memory_.size(); }
  std::span<const std::byte> instance_memory() const { return cloth_memory_; }
  dcloth_cloth* cloth() const { return cloth_; }

 private:
  AlignedBytes bytes_, model_memory_, cloth_memory_;
  dcloth_model* model_ = nullptr;
  dcloth_cloth* cloth_ = nullptr;
  dcloth_model_info info_{};
  std::vector<std::string> joint_names_;
};

using FrameVisitor =
    std::function<void(size_t frame, std::span<const float> positions, std::span<const float> normals)>;

// Resets the cloth, then per frame: tick, skin at blend 1, visit. The sequence's fps must be the model's tick rate
// within 1 %: resampling poses belongs to the caller. `timer` may be null. Throws Error.
void Rollout(const OpenModel& model, const Sequence& sequence, uint32_t stages, const FrameVisitor& visit,
             dcloth_timer* timer = nullptr);

// Difference of two models of one garment over the sequences, each with all its stages. Throws Error.
MeshError CompareModels(const OpenModel& model, const OpenModel& reference, std::span<const Sequence> sequences);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_ROLLOUT_H_
