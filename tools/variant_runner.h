// Plays one variant of a bundle over sequences, tick by tick, and takes its times.
#ifndef DCLOTH_TOOLS_VARIANT_RUNNER_H_
#define DCLOTH_TOOLS_VARIANT_RUNNER_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "converter/bundle.h"
#include "converter/rollout.h"
#include "converter/sequence.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

namespace dcloth::tools {

struct TickSamples {
  std::vector<double> cold_ms, warm_ms;                          // tick and skin with normals
  std::array<std::vector<double>, DCLOTH_STEP_COUNT> stages_ms;  // cold
};

// The poses that `model` wants of each sequence. Models of one bundle want the same.
std::vector<PoseTrack> PosesFor(const converter::OpenModel& model, std::span<const converter::Sequence> sequences);

class VariantRunner {
 public:
  // Runners of one model share its one cloth: each call below starts from a reset. All arguments outlive it.
  VariantRunner(const converter::Bundle& bundle, const converter::OpenModel& model, uint32_t stages,
                std::span<const converter::Sequence> sequences, std::span<const PoseTrack> poses,
                uint32_t output_flags = 0);

  struct Positions {
    std::vector<float> positions;  // [ticks, n, 3]
    double held_mm = 0;            // how far vertices move a tick while the last pose is held
  };
  // The whole sequence back to back; milliseconds per tick go to `warm_ms`, which may be null. Then the last pose is
  // held for `held_to` ticks, and held_mm is the mean over those from `held_from` on; 0 where nothing is held.
  Positions Play(size_t index, std::vector<double>* warm_ms, size_t held_from = 0, size_t held_to = 0) const;

  // Ticks [first, last) of the sequence, as far as it goes, with the caches emptied before each.
  void PlayCold(size_t index, size_t first, size_t last, CacheEvictor* evictor, TickSamples* samples) const;

 private:
  const converter::Bundle& bundle_;
  const converter::OpenModel& model_;
  uint32_t stages_, output_flags_;
  std::span<const converter::Sequence> sequences_;
  std::span<const PoseTrack> poses_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_VARIANT_RUNNER_H_
