// The variants of a bundle that `dcloth evaluate` measures: which, their models, and playing them.
#ifndef DCLOTH_TOOLS_VARIANTS_H_
#define DCLOTH_TOOLS_VARIANTS_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "converter/bundle.h"
#include "converter/model_maker.h"
#include "converter/rollout.h"
#include "converter/sequence.h"
#include "tools/evaluation.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

namespace dcloth::tools {

struct Job {
  std::string name;  // "int8", "int8/skeleton", "int8@64", "int8@64/skeleton", "int8/outside"
  converter::Precision precision;
  uint32_t rank;  // rows of the displacement basis that these stages read; 0 for the static stage alone
  uint32_t stages;
  const converter::OpenModel* model;
  bool shown;  // in the report's 3D view; the grid's further variants are figures only
  uint32_t output_flags = 0;
};

class VariantGrid {
 public:
  // Always: the last precision stopped after each earlier stage, each precision with all stages, the last one kept
  // outside the body where the model holds one. With options.pareto also what is missing of precision x rank x stages;
  // the static stage has no rank.
  VariantGrid(const converter::Bundle& bundle, converter::ModelMaker* maker, const EvaluationOptions& options);

  std::span<const Job> jobs() const { return jobs_; }

 private:
  struct Made {
    converter::Precision precision;
    uint32_t asked, rows;  // rank as RankMaker takes it; rows when all stages run
    converter::OpenModel model;
  };

  const Made& Make(converter::Precision precision, uint32_t rank);
  void Add(const Made& made, uint32_t stages, bool shown);
  void AddGrid(const EvaluationOptions& options);

  const converter::Bundle& bundle_;
  converter::ModelMaker* maker_;
  std::deque<Made> models_;  // a job points to its own
  std::vector<Job> jobs_;
};

struct TickSamples {
  std::vector<double> cold_ms, warm_ms;                          // tick and skin with normals
  std::array<std::vector<double>, DCLOTH_STEP_COUNT> stages_ms;  // cold
};

// The poses that `model` wants of each sequence. Models of one bundle want the same.
std::vector<PoseTrack> PosesFor(const converter::OpenModel& model, std::span<const converter::Sequence> sequences);

// Plays one variant of a bundle over sequences, tick by tick, and takes its times.
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

#endif  // DCLOTH_TOOLS_VARIANTS_H_
