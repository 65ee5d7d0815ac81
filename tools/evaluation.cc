#include "tools/evaluation.h"

#include <algorithm>
#include <cmath>

#include "converter/convert.h"
#include "converter/error.h"
#include "tools/baseline.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/progress.h"

namespace dcloth::tools {
namespace {

using converter::Bundle;
using converter::ErrorMeter;
using converter::OpenModel;
using converter::Sequence;

// The model's own poses of each sequence, one per tick.
std::vector<PoseTrack> PosesFor(const OpenModel& model, std::span<const Sequence> sequences) {
  std::vector<PoseTrack> poses;
  for (const Sequence& s : sequences) poses.emplace_back(s, model.joint_names());
  return poses;
}

// Tick and skin from a reset, one call a tick. Returns milliseconds per tick.
class Runner {
 public:
  Runner(const Bundle& bundle, const OpenModel& model, uint32_t stages, std::span<const Sequence> sequences,
         uint32_t output_flags = 0)
      : bundle_(bundle),
        sequences_(sequences),
        model_(model),
        stages_(stages),
        output_flags_(output_flags),
        poses_(PosesFor(model, sequences)) {}

  std::vector<float> Play(size_t index, std::vector<double>* warm_ms) {
    const size_t ticks = TickCount(bundle_, sequences_[index]), step = FramesPerTick(bundle_, sequences_[index]);
    Player player(model_, stages_, converter::PathText(sequences_[index].path), output_flags_);
    std::vector<float> positions;
    positions.reserve(ticks * player.positions().size());
    player.Reset();
    for (size_t t = 0; t < ticks; ++t) {
      const std::span<const float> pose = poses_[index].Frame(t * step);
      const uint64_t start = NowNanoseconds();
      player.Tick(pose);
      player.Skin(pose, 1);
      if (warm_ms != nullptr) warm_ms->push_back(static_cast<double>(NowNanoseconds() - start) * 1e-6);
      positions.insert(positions.end(), player.positions().begin(), player.positions().end());
    }
    return positions;
  }

  void PlayCold(size_t index, size_t limit, CacheEvictor* evictor, std::vector<double>* cold_ms,
                std::array<std::vector<double>, DCLOTH_STEP_COUNT>* stages_ms) {
    const size_t ticks = std::min(limit, TickCount(bundle_, sequences_[index]));
    const size_t step = FramesPerTick(bundle_, sequences_[index]);
    Player player(model_, stages_, converter::PathText(sequences_[index].path), output_flags_);
    StepTimer timer;
    player.Reset();
    for (size_t t = 0; t < ticks; ++t) {
      const std::span<const float> pose = poses_[index].Frame(t * step);
      evictor->Evict();
      const uint64_t start = NowNanoseconds();
      player.Tick(pose, timer.get());
      player.Skin(pose, 1, timer.get());
      cold_ms->push_back(static_cast<double>(NowNanoseconds() - start) * 1e-6);
      const StepTimes times = timer.Take();
      for (size_t s = 0; s < times.size(); ++s) (*stages_ms)[s].push_back(static_cast<double>(times[s]) * 1e-6);
    }
  }

 private:
  const Bundle& bundle_;
  std::span<const Sequence> sequences_;
  const OpenModel& model_;
  uint32_t stages_, output_flags_;
  std::vector<PoseTrack> poses_;
};

TickTimes MeasureCold(Runner* runner, size_t sequence_count, size_t cold_ticks, std::vector<double> warm_ms) {
  CacheEvictor evictor;
  std::vector<double> cold_ms;
  std::array<std::vector<double>, DCLOTH_STEP_COUNT> stages_ms;
  const size_t limit = std::max<size_t>(10, (cold_ticks + sequence_count - 1) / sequence_count);
  for (size_t s = 0; s < sequence_count; ++s) runner->PlayCold(s, limit, &evictor, &cold_ms, &stages_ms);
  TickTimes times;
  times.cold_count = cold_ms.size();
  times.warm_count = warm_ms.size();
  times.cold_ms = PercentilesOf(cold_ms);
  times.warm_ms = PercentilesOf(warm_ms);
  for (size_t s = 0; s < stages_ms.size(); ++s) times.stages_ms[s] = PercentilesOf(stages_ms[s]);
  return times;
}

// Errors of one variant: per sequence and over all.
class Errors {
 public:
  Errors(std::span<const uint16_t> triangles, size_t vertex_count, const Bundle& bundle)
      : triangles_(triangles),
        vertex_count_(vertex_count),
        bundle_(bundle),
        truth_(triangles, vertex_count),
        fp32_(triangles, vertex_count) {}

  ErrorPair Add(const Sequence& sequence, std::span<const float> positions, std::span<const float> reference) {
    ErrorMeter truth(triangles_, vertex_count_), fp32(triangles_, vertex_count_);
    const size_t size = vertex_count_ * 3, step = FramesPerTick(bundle_, sequence);
    for (size_t t = 0; (t + 1) * size <= positions.size(); ++t) {
      const std::span<const float> frame = positions.subspan(t * size, size);
      for (ErrorMeter* meter : {&fp32, &fp32_}) meter->AddFrame(frame, reference.subspan(t * size, size));
      if (!sequence.has_truth()) continue;
      for (ErrorMeter* meter : {&truth, &truth_}) meter->AddFrame(frame, sequence.FrameTruth(t * step));
    }
    return {.truth = truth.Result(), .fp32 = fp32.Result()};
  }
  ErrorPair Total() const { return {.truth = truth_.Result(), .fp32 = fp32_.Result()}; }

 private:
  std::span<const uint16_t> triangles_;
  size_t vertex_count_;
  const Bundle& bundle_;
  ErrorMeter truth_, fp32_;
};

std::vector<float> PlayPlainSkinning(const Bundle& bundle, const Sequence& sequence) {
  const PlainSkinning skinning(bundle);
  const std::vector<double> inverse_bind = InverseBind(bundle);
  const PoseTrack poses(sequence, bundle.joint_names);
  const size_t step = FramesPerTick(bundle, sequence), ticks = TickCount(bundle, sequence);
  const size_t size = size_t{bundle.vertex_count()} * 3;
  std::vector<float> matrices(bundle.joint_names.size() * 12), positions(ticks * size);
  for (size_t t = 0; t < ticks; ++t) {
    SkinningMatrices(inverse_bind, poses.Frame(t * step), matrices);
    skinning.Skin(matrices, std::span(positions).subspan(t * size, size));
  }
  return positions;
}

struct Job {
  std::string name;
  uint32_t stages;
  const OpenModel* model;
  uint32_t output_flags = 0;
};

}  // namespace

size_t FramesPerTick(const Bundle& bundle, const Sequence& sequence) {
  const double ratio = sequence.fps / bundle.tick_rate, whole = std::round(ratio);
  if (whole < 1 || std::abs(ratio - whole) > 0.01 * whole) {
    throw converter::Error({.path = sequence.path,
                            .tensor = {},
                            .found = "fps " + std::to_string(sequence.fps),
                            .expected = "a multiple of the tick rate, " + std::to_string(bundle.tick_rate),
                            .mend = "resample the sequence, or use `dcloth run`, which resamples poses"});
  }
  if (sequence.has_truth() && sequence.truth_vertex_count != bundle.vertex_count()) {
    throw converter::Error({.path = sequence.path,
                            .tensor = "truth",
                            .found = std::to_string(sequence.truth_vertex_count) + " vertices",
                            .expected = std::to_string(bundle.vertex_count()) + ", those of '" + bundle.garment + "'",
                            .mend = "evaluate the garment that the sequence was simulated with"});
  }
  return static_cast<size_t>(whole);
}

size_t TickCount(const Bundle& bundle, const Sequence& sequence) {
  return (sequence.frame_count - 1) / FramesPerTick(bundle, sequence) + 1;
}

std::vector<Variant> Evaluate(const Bundle& bundle, std::span<const Sequence> sequences,
                              const EvaluationOptions& options, const PlayedVisitor& visit) {
  for (const Sequence& s : sequences) FramesPerTick(bundle, s);
  Progress progress("evaluating");
  const auto open = [&](converter::Precision precision, converter::RankMode rank = converter::RankMode::kExact) {
    converter::ConvertOptions convert;
    convert.precision = precision;
    convert.rank.mode = rank;
    return OpenModel(converter::Convert(bundle, convert).bytes, bundle.path);
  };
  const OpenModel reference = open(converter::Precision::kFp32, converter::RankMode::kFull);
  std::vector<OpenModel> models;
  models.reserve(options.precisions.size());
  for (converter::Precision p : options.precisions) models.push_back(open(p));

  std::vector<Job> jobs;
  const OpenModel& last = models.back();
  for (uint32_t stages : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON}) {
    if ((stages & ~last.info().stages) != 0 || stages == last.info().stages) continue;
    jobs.push_back(
        {std::string(converter::PrecisionName(options.precisions.back())) + "/" + StagesName(stages), stages, &last});
  }
  for (size_t i = 0; i < models.size(); ++i) {
    jobs.push_back({converter::PrecisionName(options.precisions[i]), models[i].info().stages, &models[i]});
  }
  if (dcloth_model_body_vertex_count(last.model()) != 0) {
    const std::string name = std::string(converter::PrecisionName(options.precisions.back())) + "/outside";
    jobs.push_back({name, last.info().stages, &last, DCLOTH_OUTPUT_OUTSIDE_BODY});
  }

  const size_t total = (jobs.size() + 2) * sequences.size();
  size_t done = 0;
  std::vector<std::vector<float>> expected;  // the fp32 engine's positions
  {
    Runner runner(bundle, reference, reference.info().stages, sequences);
    for (size_t s = 0; s < sequences.size(); ++s, progress.Step(++done, total))
      expected.push_back(runner.Play(s, nullptr));
  }

  std::vector<Variant> variants;
  const auto measure = [&](Variant variant, auto&& play) {
    Errors errors(reference.triangles(), bundle.vertex_count(), bundle);
    for (size_t s = 0; s < sequences.size(); ++s, progress.Step(++done, total)) {
      const std::vector<float> positions = play(s);
      variant.sequences.push_back(errors.Add(sequences[s], positions, expected[s]));
      visit({.variant = variant.name, .sequence = s, .positions = positions});
    }
    variant.error = errors.Total();
    variants.push_back(std::move(variant));
  };
  Variant baseline;
  baseline.name = "skinning";
  baseline.stages = "none";
  measure(std::move(baseline), [&](size_t s) { return PlayPlainSkinning(bundle, sequences[s]); });
  for (const Job& job : jobs) {
    Variant variant;
    variant.name = job.name;
    variant.stages = StagesName(job.stages);
    variant.model_bytes = job.model->bytes().size();
    variant.instance_bytes = job.model->instance_bytes();
    Runner runner(bundle, *job.model, job.stages, sequences, job.output_flags);
    std::vector<double> warm_ms;
    measure(std::move(variant), [&](size_t s) { return runner.Play(s, &warm_ms); });
    variants.back().times = MeasureCold(&runner, sequences.size(), options.cold_ticks, std::move(warm_ms));
  }
  return variants;
}

}  // namespace dcloth::tools
