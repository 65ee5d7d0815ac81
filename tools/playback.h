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

// What is drawn of a frame beside positions.
struct Drawn {
  uint32_t flags = 0;  // DCLOTH_OUTPUT_*
  bool normals = true, tangents = false;
  bool half = false;  // all attributes as 16-bit floats
};

// Drives one cloth of `model`, both of which must outlive this. Stages are at most what the model holds, and so are
// texture coordinates and the coarse mesh; throws otherwise.
class Player {
 public:
  // `cloth` null: the one of `model` itself.
  Player(const converter::OpenModel& model, uint32_t stages, std::string source, const Drawn& drawn = {},
         dcloth_cloth* cloth = nullptr);

  // Other stages, and what is drawn, from now on.
  void Ask(uint32_t stages, const Drawn& drawn);

  void Reset();
  void SetWind(const std::array<float, 3>& wind);  // m/s, for ticks from now on
  void Tick(std::span<const float> pose, dcloth_timer* timer = nullptr);
  void Skin(std::span<const float> pose, float blend, dcloth_timer* timer = nullptr);

  // dcloth_cloth_update; `draw` false leaves positions() and normals() alone. Returns ticks run, parts
  // included.
  double Update(std::span<const float> pose, float seconds, uint32_t flags, bool draw, dcloth_timer* timer = nullptr);

  // What a frame reads and writes leaves the caches: the model, the instance, the pose and what was drawn.
  void Cool(std::span<const float> pose, CacheEvictor* evictor) const;

  // Of the last Skin or Update, [n, 3] world, metres; n vertices of the mesh that is drawn. Not for half floats.
  std::span<const float> positions() const { return positions_; }
  std::span<const float> normals() const { return normals_; }
  std::vector<float> ReadPositions() const;  // the same, of half floats too
  uint32_t stages() const { return stages_; }

 private:
  void Check(dcloth_status status, const char* what) const;
  dcloth_pose Pose(std::span<const float> matrices) const;
  dcloth_output Output();

  const converter::OpenModel& model_;
  dcloth_cloth* cloth_;
  uint32_t stages_;
  Drawn drawn_;
  std::string source_;  // names the sequence in errors
  uint32_t vertex_count_ = 0;
  std::vector<float> positions_, normals_, tangents_;  // memory that half floats fill by half
  std::vector<std::byte> scratch_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PLAYBACK_H_
