// Plays a model: the host's side of dcloth.h, with memory lent and every status checked.
#ifndef DCLOTH_TOOLS_PLAYBACK_H_
#define DCLOTH_TOOLS_PLAYBACK_H_

#include <array>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "converter/rollout.h"
#include "converter/stages.h"
#include "dcloth/dcloth.h"
#include "tools/timing.h"

namespace dcloth::tools {

converter::OpenModel OpenModelFile(const std::filesystem::path& path);

using converter::ParseStages;
using converter::StagesName;
double TickRate(const converter::OpenModel& model);  // Hz, rounded to the float's own precision

// Drives the one cloth of `model`, which must outlive this. Stages are at most what the model holds; throws otherwise.
class Player {
 public:
  // `output_flags` are DCLOTH_OUTPUT_*.
  Player(const converter::OpenModel& model, uint32_t stages, std::string source, uint32_t output_flags = 0);

  void Reset();
  void SetWind(const std::array<float, 3>& wind);  // m/s, for ticks from now on
  void Tick(std::span<const float> pose, dcloth_timer* timer = nullptr);
  void Skin(std::span<const float> pose, float blend, dcloth_timer* timer = nullptr);

  // dcloth_cloth_update; `draw` false leaves positions() and normals() alone. Returns ticks run, parts
  // included.
  double Update(std::span<const float> pose, float seconds, uint32_t flags, bool draw, dcloth_timer* timer = nullptr);

  // What a frame reads and writes leaves the caches: the model, the instance, the pose and what was drawn.
  void Cool(std::span<const float> pose, CacheEvictor* evictor) const;

  std::span<const float> positions() const { return positions_; }  // of the last Skin or Update, [n, 3] world, metres
  std::span<const float> normals() const { return normals_; }
  uint32_t stages() const { return stages_; }

 private:
  void Check(dcloth_status status, const char* what) const;
  dcloth_pose Pose(std::span<const float> matrices) const;
  dcloth_output Output();

  const converter::OpenModel& model_;
  uint32_t stages_, output_flags_;
  std::string source_;  // names the sequence in errors
  std::vector<float> positions_, normals_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PLAYBACK_H_
