// What profiling measured, and its faces: JSON, text, Chrome trace.
#ifndef DCLOTH_TOOLS_PROFILE_OUTPUT_H_
#define DCLOTH_TOOLS_PROFILE_OUTPUT_H_

#include <array>
#include <filesystem>
#include <string>
#include <vector>

#include "converter/metrics.h"
#include "converter/model_work.h"
#include "tools/json_output.h"
#include "tools/machine_limit.h"
#include "tools/part_timer.h"
#include "tools/timing.h"

namespace dcloth::tools {

struct ProfiledFrame {
  uint64_t start_ns = 0, tick_ns = 0, skin_ns = 0;
  uint64_t work_ns = 0;  // of these two, what the thread ran
  double ticks = 0;      // run in this frame, parts included, by estimated cost
  StepTimes tick_steps{}, skin_steps{};
  PartTimes parts{};  // 0 where a piece did not run, and for a tick that is spread over frames
};

struct Profile {
  std::string model, sequence, garment, precision, stages;
  std::vector<std::string> output;
  uint64_t model_bytes = 0, instance_bytes = 0;
  double fps = 0, tick_rate = 0;
  double budget_ms = 0;  // 0: none
  int core = -1;         // -1: not pinned
  bool pipelined = false, cold = false, contend = false, project = false, contact = false;
  std::vector<ProfiledFrame> frames;
  std::vector<double> interrupted_ms;  // frames during which the system ran something else; in no other figure
  converter::MeshError error;          // of the drawn frames that fall on a frame with truth
  converter::ModelWork work{};
  MachineLimit limit;  // taken before the neighbour starts

  size_t missed_frames() const;  // 0 without a budget
};

double FrameMs(const ProfiledFrame& frame);
Json ProfileJson(const Profile& profile);
void PrintProfile(const Profile& profile);
// Chrome's trace event format: open in chrome://tracing or ui.perfetto.dev. Steps lie in the engine's order within
// their call; their lengths are measured, the gaps between them are not.
void WriteTrace(const std::filesystem::path& path, const Profile& profile);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PROFILE_OUTPUT_H_
