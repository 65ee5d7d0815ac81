// `dcloth profile --characters`: a crowd in one garment, planned by a scene on each of one or two cores.
#ifndef DCLOTH_TOOLS_PROFILE_CROWD_H_
#define DCLOTH_TOOLS_PROFILE_CROWD_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "converter/sequence.h"
#include "dcloth/dcloth_scene.h"
#include "tools/json_output.h"
#include "tools/playback.h"
#include "tools/timing.h"

namespace dcloth::tools {

struct CrowdOptions {
  std::string source;  // names the sequence in errors
  size_t characters = 1, workers = 1, frames = 600;
  uint32_t stages = DCLOTH_STAGES_MESH;
  Drawn drawn;             // at DCLOTH_DRAW_FULL
  double fps = 60;         // drawn frames a second
  double budget_ms = 0;    // a frame on each core; 0: all of each character in every frame
  std::vector<int> cores;  // [workers]; empty where threads are not pinned
};

// What a level of one character costs and how far it is off, in the mean over the sequence.
struct CrowdLevel {
  double tick_ms = 0;
  double error_mm = 0;  // to the truth of the sequence, or where it has none to the network's own best
};

struct CrowdWorker {
  size_t characters = 0;
  std::array<double, DCLOTH_DRAW_COUNT> draw_ms{};  // measured in turns over the worker's characters
  std::array<double, DCLOTH_LEVEL_COUNT> levels{};  // characters at each, in the mean frame
  std::array<double, DCLOTH_DRAW_COUNT> draws{};    // characters drawn so
  std::vector<double> frame_ms, interrupted_ms;
  double longest_wait_ms = 0;  // of a character for its tick
};

struct CrowdProfile {
  CrowdOptions options;
  bool has_truth = false;
  double tick_rate = 0;                               // Hz
  std::array<CrowdLevel, DCLOTH_LEVEL_COUNT> levels;  // the unused one is zero
  std::vector<CrowdWorker> workers;
  double error_mm = 0;  // of what is seen: who is not drawn in a frame is where the hips carried the last drawing

  size_t missed_frames() const;  // of all workers; 0 without a budget
  size_t late_frames() const;    // those over it by more than 5 %
};

// Characters start at other places of the sequence, and at its end jump to its start. The first second is not counted.
CrowdProfile ProfileCrowd(const converter::OpenModel& model, const converter::Sequence& sequence,
                          const CrowdOptions& options);

Json CrowdJson(const CrowdProfile& profile);
void PrintCrowd(const CrowdProfile& profile);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PROFILE_CROWD_H_
