#include "tools/evaluation.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "converter/error.h"
#include "converter/model_maker.h"
#include "tools/baseline.h"
#include "tools/pareto.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/progress.h"
#include "tools/variants.h"

namespace dcloth::tools {
namespace {

using converter::Bundle;
using converter::ErrorMeter;
using converter::OpenModel;
using converter::Sequence;

// Ticks of the last pose, held after a sequence, between which vertices should have come to rest.
constexpr size_t kHeldFrom = 30, kHeldTo = 60;

// The truths of the sequences that have one, as predictions are compared with them.
class Truths {
 public:
  Truths(const Bundle& bundle, const OpenModel& model, std::span<const Sequence> sequences)
      : mesh_(model.triangles(), std::span(bundle.template_positions.data(), size_t{bundle.vertex_count()} * 3)) {
    for (const Sequence& sequence : sequences) {
      clips_.emplace_back();
      if (!sequence.has_truth()) continue;
      const PoseTrack poses(sequence, bundle.joint_names);
      const size_t step = FramesPerTick(bundle, sequence);
      std::vector<converter::ClipTruth::Frame> frames;
      std::vector<converter::ClipTruth::Hips> hips;
      for (size_t t = 0; t < TickCount(bundle, sequence); ++t) {
        frames.push_back(sequence.FrameTruth(t * step));
        std::copy_n(&poses.Frame(t * step)[16 * size_t{bundle.hips}], 12, hips.emplace_back().begin());
      }
      clips_.back().emplace(mesh_, std::move(frames), std::move(hips));
    }
  }

  // Null without truth.
  const converter::ClipTruth* of(size_t sequence) const { return clips_[sequence] ? &*clips_[sequence] : nullptr; }

 private:
  converter::ClothMesh mesh_;
  std::vector<std::optional<converter::ClipTruth>> clips_;
};

// Errors over several sequences.
class Total {
 public:
  Total(std::span<const uint16_t> triangles, size_t vertex_count)
      : truth_(triangles, vertex_count), fp32_(triangles, vertex_count) {}

  void Add(const ErrorMeter& truth, const ErrorMeter& fp32, const ErrorPair& clip) {
    truth_.Add(truth), fp32_.Add(fp32);
    if (clip.truth.frame_count == 0) return;
    motion_.push_back(clip.motion);
    position_mm_ += clip.truth.position_mm.mean, normal_deg_ += clip.truth.normal_deg.mean;
  }

  ErrorPair Result() const {
    ErrorPair out{.truth = truth_.Result(), .motion = converter::OverClips(motion_), .fp32 = fp32_.Result()};
    if (motion_.empty()) return out;
    out.truth.position_mm.mean = position_mm_ / static_cast<double>(motion_.size());
    out.truth.normal_deg.mean = normal_deg_ / static_cast<double>(motion_.size());
    return out;
  }

 private:
  ErrorMeter truth_, fp32_;
  std::vector<converter::ClipError> motion_;
  double position_mm_ = 0, normal_deg_ = 0;
};

// Errors of one variant: per sequence, over all, over the recorded and over the scripted ones.
class Errors {
 public:
  Errors(std::span<const uint16_t> triangles, const Bundle& bundle, const Truths& truths)
      : triangles_(triangles),
        bundle_(bundle),
        truths_(truths),
        all_(triangles, bundle.vertex_count()),
        recorded_(triangles, bundle.vertex_count()),
        scripted_(triangles, bundle.vertex_count()) {}

  ErrorPair Add(const Sequence& sequence, size_t index, std::span<const float> positions,
                std::span<const float> reference, double held_mm) {
    const size_t vertex_count = bundle_.vertex_count();
    ErrorMeter truth(triangles_, vertex_count), fp32(triangles_, vertex_count);
    const size_t size = vertex_count * 3, step = FramesPerTick(bundle_, sequence), ticks = positions.size() / size;
    for (size_t t = 0; t < ticks; ++t) {
      const std::span<const float> frame = positions.subspan(t * size, size);
      fp32.AddFrame(frame, reference.subspan(t * size, size));
      if (!sequence.has_truth() || t < converter::FirstCounted(ticks)) continue;
      truth.AddFrame(frame, sequence.FrameTruth(t * step));
    }
    ErrorPair out{.truth = truth.Result(), .motion = {}, .fp32 = fp32.Result()};
    if (const converter::ClipTruth* const clip = truths_.of(index)) {
      out.motion = clip->Compare(positions);
      out.motion.held_mm = held_mm;
    }
    all_.Add(truth, fp32, out);
    (sequence.scripted() ? scripted_ : recorded_).Add(truth, fp32, out);
    return out;
  }

  void Finish(Variant* variant) const {
    variant->error = all_.Result();
    variant->recorded = recorded_.Result(), variant->scripted = scripted_.Result();
  }

 private:
  std::span<const uint16_t> triangles_;
  const Bundle& bundle_;
  const Truths& truths_;
  Total all_, recorded_, scripted_;
};

// The template fixed to the hips: what a garment without any cloth is worth.
std::vector<float> PlayRigidHips(const Bundle& bundle, const Sequence& sequence) {
  const std::vector<double> inverse_bind = InverseBind(bundle);
  const PoseTrack poses(sequence, bundle.joint_names);
  const size_t step = FramesPerTick(bundle, sequence), ticks = TickCount(bundle, sequence);
  const size_t size = size_t{bundle.vertex_count()} * 3;
  std::vector<float> matrices(bundle.joint_names.size() * 12), positions(ticks * size);
  const float* const points = bundle.template_positions.data();
  for (size_t t = 0; t < ticks; ++t) {
    SkinningMatrices(inverse_bind, poses.Frame(t * step), matrices);
    const float* const hips = &matrices[12 * size_t{bundle.hips}];
    for (size_t i = 0; i < size; i += 3) {
      for (size_t r = 0; r < 3; ++r) {
        positions[t * size + i + r] = hips[4 * r] * points[i] + hips[4 * r + 1] * points[i + 1] +
                                      hips[4 * r + 2] * points[i + 2] + hips[4 * r + 3];
      }
    }
  }
  return positions;
}

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

// One variant while it is measured.
struct Measured {
  const Job* job;
  VariantRunner runner;
  TickSamples samples;
};

TickTimes TimesOf(const TickSamples& samples) {
  TickTimes times;
  times.cold_count = samples.cold_ms.size();
  times.warm_count = samples.warm_ms.size();
  times.cold_ms = PercentilesOf(samples.cold_ms);
  times.warm_ms = PercentilesOf(samples.warm_ms);
  for (size_t s = 0; s < samples.stages_ms.size(); ++s) times.stages_ms[s] = PercentilesOf(samples.stages_ms[s]);
  return times;
}

constexpr size_t kBaselines = 2;  // rigid hips and plain skinning, before the measured variants

using StepCallback = std::function<void()>;
constexpr size_t kColdRounds = 4;

// Variants alternate, so that a machine that slows down slows all of them.
void MeasureCold(std::vector<Measured>* variants, size_t sequence_count, size_t cold_ticks, const StepCallback& step) {
  CacheEvictor evictor;
  const size_t per_sequence = std::max<size_t>(10, (cold_ticks + sequence_count - 1) / sequence_count);
  const size_t piece = (per_sequence + kColdRounds - 1) / kColdRounds;
  for (size_t round = 0; round < kColdRounds; ++round) {
    const size_t first = round * piece, last = std::min(per_sequence, first + piece);
    for (Measured& variant : *variants) {
      for (size_t s = 0; s < sequence_count; ++s) variant.runner.PlayCold(s, first, last, &evictor, &variant.samples);
      step();
    }
  }
}

// What keeps the garment outside the body does more than the others and competes with none of them.
void MarkDominated(std::span<const Measured> measured, std::vector<Variant>* variants) {
  std::vector<size_t> rows;
  std::vector<ParetoPoint> points;
  for (size_t i = 0; i < measured.size(); ++i) {
    Variant& variant = (*variants)[i + kBaselines];
    if (measured[i].job->output_flags != 0) continue;
    rows.push_back(i + kBaselines);
    points.push_back({variant.times->cold_ms.p50, variant.error.compared().position_mm.mean});
  }
  const std::vector<std::optional<size_t>> by = DominatedBy(points);
  for (size_t i = 0; i < rows.size(); ++i) {
    Variant& variant = (*variants)[rows[i]];
    variant.place = by[i] ? ParetoPlace::kDominated : ParetoPlace::kFront;
    if (by[i]) variant.dominated_by = (*variants)[rows[*by[i]]].name;
  }
}

}  // namespace

size_t FramesPerTick(const Bundle& bundle, const Sequence& sequence) {
  const double ratio = sequence.fps / bundle.tick_rate, whole = std::round(ratio);
  if (whole < 1 || std::abs(ratio - whole) > 0.01 * whole) {
    throw converter::Error({.path = sequence.path,
                            .tensor = {},
                            .found = "fps " + converter::NumberText(sequence.fps),
                            .expected = "a multiple of the tick rate of " + converter::NumberText(bundle.tick_rate),
                            .mend = "resample the sequence, or use `dcloth run`, which resamples poses"});
  }
  if (sequence.has_truth() && sequence.truth_vertex_count != bundle.vertex_count()) {
    throw converter::Error({.path = sequence.path,
                            .tensor = "truth",
                            .found = std::to_string(sequence.truth_vertex_count) + " vertices",
                            .expected = std::to_string(bundle.vertex_count()) + ", as '" + bundle.garment + "' has",
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
  converter::ModelMaker maker(bundle, options.calibration);
  const OpenModel reference = maker.Make(converter::Precision::kFp32, converter::RankMaker::kFullRank).model;
  const VariantGrid grid(bundle, &maker, options);
  const std::vector<PoseTrack> poses = PosesFor(reference, sequences);

  const size_t total = (grid.jobs().size() + 1 + kBaselines) * sequences.size() + kColdRounds * grid.jobs().size();
  size_t done = 0;
  const auto step = [&] { progress.Step(++done, total); };
  std::vector<std::vector<float>> expected;  // the fp32 engine's positions
  {
    VariantRunner runner(bundle, reference, reference.info().stages, sequences, poses);
    for (size_t s = 0; s < sequences.size(); ++s, step()) expected.push_back(runner.Play(s, nullptr).positions);
  }

  const Truths truths(bundle, reference, sequences);
  std::vector<Variant> variants;
  const auto measure = [&](Variant variant, bool shown, auto&& play) {
    Errors errors(reference.triangles(), bundle, truths);
    for (size_t s = 0; s < sequences.size(); ++s, step()) {
      const VariantRunner::Positions played = play(s);
      variant.sequences.push_back(errors.Add(sequences[s], s, played.positions, expected[s], played.held_mm));
      if (shown) visit({.variant = variant.name, .sequence = s, .positions = played.positions});
    }
    errors.Finish(&variant);
    variants.push_back(std::move(variant));
  };
  Variant baseline;
  baseline.name = "rigid";
  baseline.stages = "none";
  measure(baseline, false, [&](size_t s) { return VariantRunner::Positions{PlayRigidHips(bundle, sequences[s]), 0}; });
  baseline.name = "skinning";
  measure(std::move(baseline), true, [&](size_t s) {
    return VariantRunner::Positions{PlayPlainSkinning(bundle, sequences[s]), 0};
  });
  std::vector<Measured> measured;
  measured.reserve(grid.jobs().size());
  for (const Job& job : grid.jobs()) {
    Variant variant;
    variant.name = job.name;
    variant.stages = StagesName(job.stages);
    variant.precision = converter::PrecisionName(job.precision);
    variant.rank = job.rank;
    variant.model_bytes = job.model->bytes().size();
    variant.instance_bytes = job.model->instance_bytes();
    measured.push_back(
        {&job, VariantRunner(bundle, *job.model, job.stages, sequences, poses, job.output_flags), TickSamples{}});
    Measured& last = measured.back();
    measure(std::move(variant), job.shown,
            [&](size_t s) { return last.runner.Play(s, &last.samples.warm_ms, kHeldFrom, kHeldTo); });
  }
  MeasureCold(&measured, sequences.size(), options.cold_ticks, step);
  for (size_t i = 0; i < measured.size(); ++i) variants[i + kBaselines].times = TimesOf(measured[i].samples);
  MarkDominated(measured, &variants);
  return variants;
}

}  // namespace dcloth::tools
