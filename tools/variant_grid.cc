#include "tools/variant_grid.h"

#include <algorithm>

#include "tools/playback.h"

namespace dcloth::tools {
namespace {

using converter::Precision;
using converter::RankMaker;

constexpr uint32_t kLevels[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};

// Those that differ: a patch stage runs at both of the last two.
std::vector<uint32_t> LevelsOf(const converter::Bundle& bundle, uint32_t all) {
  std::vector<uint32_t> levels;
  for (const uint32_t stages : kLevels) {
    if ((stages & ~all) == 0 && (stages != DCLOTH_STAGES_SKELETON || bundle.skeleton)) levels.push_back(stages);
  }
  return levels;
}

// Asked-for ranks as they are stored, largest first; without any, halves of the exact one.
std::vector<uint32_t> LowerRanks(const EvaluationOptions& options, uint32_t exact) {
  std::vector<uint32_t> asked = options.ranks, ranks;
  if (asked.empty() && !options.calibration.empty()) asked = {exact / 2, exact / 4, exact / 8};
  for (uint32_t rank : asked) ranks.push_back(converter::StoredRank(std::clamp<uint32_t>(rank, 1, exact)));
  std::erase_if(ranks, [&](uint32_t rank) { return rank >= exact; });
  std::sort(ranks.rbegin(), ranks.rend());
  ranks.erase(std::unique(ranks.begin(), ranks.end()), ranks.end());
  return ranks;
}

}  // namespace

VariantGrid::VariantGrid(const converter::Bundle& bundle, converter::ModelMaker* maker,
                         const EvaluationOptions& options)
    : bundle_(bundle), maker_(maker) {
  for (const Precision p : options.precisions) Make(p, maker->DefaultRank(p));
  const Made& last = models_.back();
  for (const uint32_t stages : LevelsOf(bundle, last.model.info().stages)) {
    if (stages != last.model.info().stages) Add(last, stages, true);
  }
  for (const Made& made : models_) Add(made, made.model.info().stages, true);
  if (options.pareto) AddGrid(options);
  if (dcloth_model_body_vertex_count(last.model.model()) != 0) {
    Add(last, last.model.info().stages, true);
    jobs_.back().name += "/outside";
    jobs_.back().output_flags = DCLOTH_OUTPUT_OUTSIDE_BODY;
  }
}

void VariantGrid::AddGrid(const EvaluationOptions& options) {
  const size_t defaults = models_.size();
  for (size_t i = 0; i < defaults; ++i) {
    const uint32_t all = models_[i].model.info().stages;
    for (const uint32_t stages : LevelsOf(bundle_, all)) {
      if (stages != all && i + 1 != defaults) Add(models_[i], stages, false);
    }
    if (!bundle_.skeleton) continue;
    for (const uint32_t rank : LowerRanks(options, maker_->exact_rank())) {
      const Made& made = Make(models_[i].precision, rank);
      for (const uint32_t stages : {DCLOTH_STAGES_MESH, DCLOTH_STAGES_SKELETON}) {
        if ((stages & ~all) == 0) Add(made, stages, false);
      }
    }
  }
}

const VariantGrid::Made& VariantGrid::Make(Precision precision, uint32_t rank) {
  converter::MadeModel made = maker_->Make(precision, rank);
  models_.push_back({precision, rank, made.rows, std::move(made.model)});
  return models_.back();
}

void VariantGrid::Add(const Made& made, uint32_t stages, bool shown) {
  Job job{converter::PrecisionName(made.precision), made.precision, made.rows, stages, &made.model, shown};
  // A basis that is not reduced is S above M; the skeleton stage alone reads S.
  if (made.asked == RankMaker::kFullRank && stages == DCLOTH_STAGES_SKELETON) {
    job.rank = static_cast<uint32_t>(bundle_.skeleton->basis.rows());
  }
  if (stages == DCLOTH_STAGES_STATIC) job.rank = 0;
  const bool lower = made.asked != RankMaker::kFullRank && made.asked < maker_->exact_rank();
  if (lower) job.name.append("@").append(std::to_string(made.asked));
  if (stages != made.model.info().stages) job.name.append("/").append(StagesName(stages));
  jobs_.push_back(std::move(job));
}

}  // namespace dcloth::tools
