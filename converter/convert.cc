#include "converter/convert.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "converter/assemble.h"
#include "converter/error.h"
#include "converter/rollout.h"

namespace dcloth::converter {
namespace {

constexpr size_t kCalibrationPoses = 256;  // evenly spaced over the motion: pruning is measured, not trained, on them

void CheckOptions(const ConvertOptions& options) {
  for (const uint32_t influences : {options.influences, options.body_influences}) {
    if (influences < 1 || influences > 8) {
      throw Error({"", "", std::to_string(influences) + " influences per vertex", "1 to 8", ""});
    }
  }
  if (options.max_error_mm && !(*options.max_error_mm >= 0 && std::isfinite(*options.max_error_mm))) {
    throw Error({"", "", "an error bound of " + std::to_string(*options.max_error_mm) + " mm", "0 or more", ""});
  }
  if (options.max_error_mm && options.motion.empty()) {
    throw Error(
        {"", "", "an error bound but no motion to measure it on", "a sequence of the character", "pass --motion SEQ"});
  }
  if (!options.precision && !options.max_error_mm) {
    throw Error(
        {"", "", "precision auto without a bound", "a bound and motion", "pass --max-error-mm E and --motion SEQ"});
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

struct Candidate {
  AlignedBytes bytes;
  std::vector<TensorReport> tensors;
};

Candidate Write(const Bundle& bundle, const FoldedBundle& folded, Precision precision) {
  try {
    const ModelParts parts = Assemble(bundle, folded, {precision, {}});
    Candidate candidate{WriteModel(parts), {}};
    for (const PackedTensor* tensor : TensorsOf(parts)) candidate.tensors.push_back(tensor->report);
    return candidate;
  } catch (const Error& error) {
    if (!error.parts().path.empty()) throw;
    ErrorParts parts = error.parts();
    parts.path = bundle.path;
    throw Error(std::move(parts));
  }
}

// The engine has the last word on what is a model.
OpenModel Open(const AlignedBytes& bytes, const Bundle& bundle) {
  try {
    return OpenModel(bytes, bundle.path);
  } catch (const Error& error) {
    throw Error({bundle.path, "", "a model that the engine refuses: " + error.parts().found, "",
                 "make the network smaller where a limit is named; else this is a fault of the converter, report it"});
  }
}

std::string Millimetres(double value) { return std::to_string(value) + " mm"; }

}  // namespace

ConvertResult Convert(const Bundle& bundle, const ConvertOptions& options) {
  CheckOptions(options);
  const FoldedBundle folded = FoldBundle(bundle, options.influences, options.body_influences);
  ConvertResult result;
  ConvertReport& report = result.report;
  report.influences =
      MeasurePruning(folded.skin_weights, folded.skin, bundle.template_positions, BindPositions(bundle, bundle.bones),
                     SkinningPoses(bundle, bundle.bones, options.motion));
  if (bundle.mesh) {
    std::vector<uint32_t> all(bundle.joint_names.size());
    for (uint32_t joint = 0; joint < all.size(); ++joint) all[joint] = joint;
    report.body_influences = MeasurePruning(folded.body_weights, folded.body, bundle.mesh->nearest_points,
                                            BindPositions(bundle, all), SkinningPoses(bundle, all, options.motion));
  }
  report.joint_count = static_cast<uint32_t>(folded.joints.joints.size());
  report.dropped_joints = static_cast<uint32_t>(bundle.joint_names.size()) - report.joint_count;

  std::optional<OpenModel> reference;
  if (!options.motion.empty()) reference.emplace(Open(Write(bundle, folded, Precision::kFp32).bytes, bundle));
  std::vector<Precision> attempts = {Precision::kInt8, Precision::kFp16, Precision::kFp32};  // cheapest first
  if (options.precision) attempts = {*options.precision};
  for (const Precision precision : attempts) {
    Candidate candidate = Write(bundle, folded, precision);
    const OpenModel model = Open(candidate.bytes, bundle);
    bool good = true;
    if (reference) {
      Trial& trial = report.trials.emplace_back(Trial{precision, candidate.bytes.size(), {}});
      trial.error = CompareModels(model, *reference, options.motion);
      good = !options.max_error_mm || trial.error.position_mm.max <= *options.max_error_mm;
    }
    if (!good) continue;
    report.precision = precision;
    report.model_bytes = candidate.bytes.size();
    report.instance_bytes = model.instance_bytes();
    report.tensors = std::move(candidate.tensors);
    MeasureTensorCosts(bundle, folded, precision, options.motion, &report.tensors, options.progress);
    result.bytes = std::move(candidate.bytes);
    return result;
  }
  // `auto` ends at fp32, whose error is 0: only an asked-for precision gets here.
  const Trial& last = report.trials.back();
  throw ThresholdError({bundle.path, "",
                        std::string(PrecisionName(last.precision)) + " to differ from fp32 by up to " +
                            Millimetres(last.error.position_mm.max),
                        "at most " + Millimetres(*options.max_error_mm),
                        "raise --max-error-mm or pass --precision auto"});
}

}  // namespace dcloth::converter
