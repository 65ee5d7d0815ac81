#include "converter/convert.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "converter/assemble.h"
#include "converter/attempts.h"
#include "converter/error.h"
#include "converter/rollout.h"
#include "converter/stages.h"
#include "converter/weight_place.h"
#include "kernels/half.h"

namespace dcloth::converter {
namespace {

constexpr size_t kCalibrationPoses = 256;  // evenly spaced over the motion: pruning is measured, not trained, on them

std::span<const Sequence> Measured(const ConvertOptions& options) {
  return options.motion.empty() ? options.calibration : options.motion;
}

void CheckOptions(const ConvertOptions& options) {
  for (const uint32_t influences : {options.influences, options.body_influences}) {
    if (influences < 1 || influences > 8) {
      throw Error({"", "", std::to_string(influences) + " influences per vertex", "1 to 8", ""});
    }
  }
  if (options.max_error_mm && !(*options.max_error_mm >= 0 && std::isfinite(*options.max_error_mm))) {
    throw Error({"", "", "an error bound of " + NumberText(*options.max_error_mm) + " mm", "0 or more", ""});
  }
  if (options.max_error_mm && Measured(options).empty()) {
    throw Error(
        {"", "", "an error bound without motion to measure it on", "a sequence of the character", "pass --motion SEQ"});
  }
  if (!options.precision && !options.max_error_mm) {
    throw Error({"", "", "precision auto without an error bound", "an error bound and motion",
                 "pass --max-error-mm E and --motion SEQ"});
  }
  if (options.rank.mode == RankMode::kSearch && (!options.max_error_mm || options.calibration.empty())) {
    throw Error({"", "", "a search for the rank without an error bound or without motion", "both",
                 "pass --max-error-mm E and --calibrate SEQ"});
  }
  if (options.rank.mode == RankMode::kFixed && options.rank.rank < 1) {
    throw Error({"", "", "a basis of rank 0", "1 or more", "leave --rank out to store the basis without loss"});
  }
}

// G B^-1 of the joints in a spread of frames.
std::vector<std::vector<Eigen::Matrix4d>> SkinningPoses(const Bundle& bundle, std::span<const uint32_t> joints,
                                                        std::span<const Sequence> motion) {
  std::vector<std::string> names;
  std::vector<Eigen::Matrix4d> inverse_bind;
  for (const uint32_t joint : joints) {
    names.push_back(bundle.joint_names[joint]);
    inverse_bind.push_back(bundle.bind[joint].cast<double>().inverse());
  }
  size_t frames = 0;
  for (const Sequence& sequence : motion) frames += sequence.frame_count;
  const size_t stride = std::max<size_t>(1, (frames + kCalibrationPoses - 1) / kCalibrationPoses);
  std::vector<std::vector<Eigen::Matrix4d>> poses;
  std::vector<float> matrices(joints.size() * 16);
  using RowMatrix4 = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  for (const Sequence& sequence : motion) {
    const std::vector<uint32_t> map = MapJoints(sequence, names);
    for (size_t frame = 0; frame < sequence.frame_count; frame += stride) {
      GatherPose(sequence, frame, map, matrices);
      std::vector<Eigen::Matrix4d>& pose = poses.emplace_back();
      for (size_t j = 0; j < joints.size(); ++j) {
        pose.push_back(Eigen::Map<const RowMatrix4>(matrices.data() + 16 * j).cast<double>() * inverse_bind[j]);
      }
    }
  }
  return poses;
}

// Tensors in which a row lost more than a twentieth of itself, or whose weights fp32 alone holds: which, by which
// weight, and what to do.
std::vector<std::string> Warnings(const Bundle& bundle, const std::vector<TensorReport>& tensors) {
  std::vector<std::string> warnings;
  for (const TensorReport& tensor : tensors) {
    const std::optional<RowLoss>& worst = tensor.loss.worst_row;
    const bool lossy = worst && worst->low_count != 0;
    const bool huge = tensor.dtype == "f32" && tensor.shape.size() == 2 &&
                      std::max(-tensor.loss.lowest, tensor.loss.highest) > static_cast<double>(kernels::kMaxHalf);
    if (!lossy && !huge) continue;
    const WeightPlace place = LargestWeight(bundle, tensor.name);
    if (place.tensor.empty()) continue;  // geometry
    if (huge) {
      warnings.push_back(tensor.name + ": stored as fp32, as fp16 ends at 65504; the largest weight is " +
                         place.tensor + place.element + " = " + NumberText(place.value) +
                         ": check whether training diverged, or clip it");
      continue;
    }
    const bool integers = tensor.dtype == "i8";
    warnings.push_back(tensor.name + ": " + std::to_string(worst->low_count) + " of " +
                       std::to_string(tensor.shape[0]) + " rows lose more than a twentieth of their size as " +
                       (integers ? "int8" : "fp16") + ", most of all row " + std::to_string(worst->row) + " (" +
                       NumberText(std::round(worst->snr_db * 10) / 10) +
                       " dB without its largest weights); the largest weight is " + place.tensor + place.element +
                       " = " + NumberText(place.value) + ": " +
                       (integers ? "clip it, or store this tensor in fp16 or fp32 (--precision auto chooses)"
                                 : "scale the small rows up, or pass --precision fp32"));
  }
  return warnings;
}

// Eigen cuts its products to the caches of the machine it runs on, and with them the order of sums: a model's last bits
// would tell where it was converted.
void SameCutsEverywhere() {
  static const bool once = (Eigen::setCpuCacheSizes(48 << 10, 1 << 20, 32 << 20), true);
  static_cast<void>(once);
}

}  // namespace

ConvertResult Convert(const Bundle& whole, const ConvertOptions& options) {
  CheckOptions(options);
  SameCutsEverywhere();
  std::optional<Bundle> kept;
  if (options.stages) kept = KeepStages(whole, *options.stages);
  const Bundle& bundle = kept ? *kept : whole;
  const FoldedBundle folded = FoldBundle(bundle, options.influences, options.body_influences);
  std::optional<OpenModel> reference;
  if (!Measured(options).empty()) {
    reference.emplace(
        ReferenceModel(whole, kept ? FoldBundle(whole, options.influences, options.body_influences) : folded));
  }
  ConvertResult result;
  ConvertReport& report = result.report;
  if (bundle.mesh) {
    std::vector<uint32_t> all(bundle.joint_names.size());
    std::iota(all.begin(), all.end(), 0u);
    report.body_influences = MeasurePruning(folded.body_weights, folded.body, bundle.mesh->nearest_points,
                                            BindPositions(bundle, all), SkinningPoses(bundle, all, Measured(options)));
  }
  report.joint_count = static_cast<uint32_t>(folded.joints.joints.size());
  report.dropped_joints = static_cast<uint32_t>(bundle.joint_names.size()) - report.joint_count;

  RankMaker ranks(bundle, folded, options.calibration);
  report.rank.full = ranks.full_rows();
  report.rank.exact = ranks.exact_rank();
  Attempts attempts(bundle, folded, options, reference ? &*reference : nullptr, &ranks, &report.trials);
  const bool settled = options.precision ? attempts.Settle({*options.precision, {}})
                                         : attempts.SettleFormats(&report.automatic.emplace());
  if (!settled) throw attempts.Missed();
  Candidate& found = attempts.found();
  report.precision = found.plan.name();
  report.stages = StagesOf(bundle);
  report.rank.rank = found.rank == RankMaker::kFullRank ? report.rank.full : found.rows;
  report.rank.reduced = found.rank != RankMaker::kFullRank;
  report.model_bytes = found.bytes.size();
  report.instance_bytes = OpenModel(found.bytes).instance_bytes();
  report.tensors = std::move(found.tensors);
  FoldedBundle stored = folded;
  stored.reduced = std::move(found.reduced);
  stored.skin = std::move(found.skin);
  report.influences =
      MeasurePruning(stored.skin_weights, stored.skin, bundle.template_positions, BindPositions(bundle, bundle.bones),
                     SkinningPoses(bundle, bundle.bones, Measured(options)));
  MeasureTensorCosts(bundle, stored, found.plan, Measured(options), &report.tensors, options.progress);
  report.warnings = Warnings(bundle, report.tensors);
  result.bytes = std::move(found.bytes);
  return result;
}

}  // namespace dcloth::converter
