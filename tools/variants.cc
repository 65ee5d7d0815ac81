#include "tools/variants.h"

#include <algorithm>

#include "converter/error.h"
#include "tools/playback.h"
#include "tools/report_scene.h"

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

double MillisecondsSince(uint64_t start) { return static_cast<double>(NowNanoseconds() - start) * 1e-6; }

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

std::vector<PoseTrack> PosesFor(const converter::OpenModel& model, std::span<const converter::Sequence> sequences) {
  std::vector<PoseTrack> poses;
  for (const converter::Sequence& s : sequences) poses.emplace_back(s, model.joint_names());
  return poses;
}

VariantRunner::VariantRunner(const converter::Bundle& bundle, const converter::OpenModel& model, uint32_t stages,
                             std::span<const converter::Sequence> sequences, std::span<const PoseTrack> poses,
                             uint32_t output_flags)
    : bundle_(bundle),
      model_(model),
      stages_(stages),
      output_flags_(output_flags),
      sequences_(sequences),
      poses_(poses) {}

VariantRunner::Positions VariantRunner::Play(size_t index, std::vector<double>* warm_ms, size_t held_from,
                                             size_t held_to) const {
  const size_t ticks = TickCount(bundle_, sequences_[index]), step = FramesPerTick(bundle_, sequences_[index]);
  Player player(model_, stages_, converter::PathText(sequences_[index].path), {.flags = output_flags_});
  Positions out;
  std::vector<float>& positions = out.positions;
  positions.reserve(ticks * player.positions().size());
  player.Reset();
  for (size_t t = 0; t < ticks; ++t) {
    const std::span<const float> pose = poses_[index].Frame(t * step);
    player.SetWind(sequences_[index].FrameWind(t * step));
    const uint64_t start = NowNanoseconds();
    player.Tick(pose);
    player.Skin(pose, 1);
    if (warm_ms != nullptr) warm_ms->push_back(MillisecondsSince(start));
    positions.insert(positions.end(), player.positions().begin(), player.positions().end());
  }
  const std::span<const float> pose = poses_[index].Frame((ticks - 1) * step);
  std::vector<float> before;
  for (size_t t = 0; t < held_to; ++t) {
    player.Tick(pose);
    if (t + 1 < held_from) continue;  // nobody looks
    player.Skin(pose, 1);
    if (t >= held_from) out.held_mm += MeanDistanceMm(player.positions(), before);
    before.assign(player.positions().begin(), player.positions().end());
  }
  if (held_to > held_from) out.held_mm /= static_cast<double>(held_to - held_from);
  return out;
}

void VariantRunner::PlayCold(size_t index, size_t first, size_t last, CacheEvictor* evictor,
                             TickSamples* samples) const {
  const size_t ticks = TickCount(bundle_, sequences_[index]), step = FramesPerTick(bundle_, sequences_[index]);
  Player player(model_, stages_, converter::PathText(sequences_[index].path), {.flags = output_flags_});
  StepTimer timer;
  player.Reset();
  for (size_t t = first; t < std::min(last, ticks); ++t) {
    const std::span<const float> pose = poses_[index].Frame(t * step);
    player.SetWind(sequences_[index].FrameWind(t * step));
    player.Cool(pose, evictor);
    const uint64_t start = NowNanoseconds();
    player.Tick(pose, timer.get());
    player.Skin(pose, 1, timer.get());
    samples->cold_ms.push_back(MillisecondsSince(start));
    const StepTimes times = timer.Take();
    for (size_t s = 0; s < times.size(); ++s) {
      samples->stages_ms[s].push_back(static_cast<double>(times[s]) * 1e-6);
    }
  }
}

}  // namespace dcloth::tools
