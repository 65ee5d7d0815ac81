#include "tests/stability/garment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <map>

#include "converter/convert.h"
#include "converter/error.h"
#include "converter/file.h"

namespace dcloth::stability {
namespace {

namespace fs = std::filesystem;

// Long enough for a disturbance between two runs of a second and more; see disturbance_test.cc.
constexpr size_t kFewestFrames = 120;

Matrix ToDouble(const Eigen::Matrix4f& matrix) { return matrix.cast<double>(); }

Clip ReadClip(const fs::path& path, const std::vector<std::string>& joints, size_t vertices) {
  converter::Sequence sequence = converter::ReadSequence(path);
  if (sequence.frame_count < kFewestFrames || sequence.truth_vertex_count != vertices) {
    throw converter::Error({path, "truth",
                            std::to_string(sequence.frame_count) + " frames of " +
                                std::to_string(sequence.truth_vertex_count) + " vertices",
                            std::to_string(kFewestFrames) + " frames or more of " + std::to_string(vertices),
                            "bundle a longer sequence with its simulated truth"});
  }
  const std::vector<uint32_t> map = converter::MapJoints(sequence, joints);
  std::vector<float> matrices(16 * joints.size());
  Clip clip{path.stem().string(), {}, std::move(sequence.truth)};
  using RowMatrix = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  for (size_t frame = 0; frame < sequence.frame_count; ++frame) {
    converter::GatherPose(sequence, frame, map, matrices);
    Pose& pose = clip.motion.emplace_back();
    for (size_t j = 0; j < joints.size(); ++j) {
      pose.push_back(Eigen::Map<const RowMatrix>(matrices.data() + 16 * j).cast<double>());
    }
  }
  return clip;
}

std::unique_ptr<converter::OpenModel> MakeModel(const Garment& garment, Precision precision) {
  if (const char* folder = std::getenv("DCLOTH_GARMENT_MODELS")) {
    const fs::path path = fs::path(folder) / (garment.name + "." + converter::PrecisionName(precision) + ".dcloth");
    return std::make_unique<converter::OpenModel>(converter::ReadFile(path), path);
  }
  converter::ConvertOptions options;
  options.precision = precision;
  return std::make_unique<converter::OpenModel>(converter::Convert(garment.bundle, options).bytes, garment.name);
}

std::unique_ptr<Garment> Read(const std::string& name) {
  const fs::path folder = fs::path(DCLOTH_MODELS_DIR) / name;
  auto garment = std::make_unique<Garment>();
  garment->name = name;
  garment->bundle = converter::ReadBundle(folder / (name + ".safetensors"));
  const converter::Bundle& bundle = garment->bundle;
  const std::vector<std::string>& joints = garment->joint_names();
  for (size_t j = 0; j < joints.size(); ++j) {
    const auto found = std::find(bundle.joint_names.begin(), bundle.joint_names.end(), joints[j]);
    const auto index = static_cast<size_t>(found - bundle.joint_names.begin());
    garment->rig.bind.push_back(ToDouble(bundle.bind[index]));
    if (index == bundle.hips) garment->rig.hips = j;
  }
  const Eigen::RowVector3f hips = bundle.bind[bundle.hips].topRightCorner<3, 1>().transpose();
  garment->size_m = static_cast<double>((bundle.template_positions.rowwise() - hips).rowwise().norm().maxCoeff());

  std::vector<fs::path> paths;
  if (fs::is_directory(folder / "sequences")) {
    for (const fs::directory_entry& entry : fs::directory_iterator(folder / "sequences")) {
      if (entry.path().extension() == ".safetensors") paths.push_back(entry.path());
    }
  }
  std::sort(paths.begin(), paths.end());
  for (const fs::path& path : paths) garment->clips.push_back(ReadClip(path, joints, garment->vertex_count()));
  if (garment->clips.empty()) {
    throw converter::Error({folder / "sequences", "", "no sequence", "one or more *.safetensors with truth", ""});
  }
  std::vector<const Motion*> motions;
  for (const Clip& clip : garment->clips) motions.push_back(&clip.motion);
  garment->rig.parents = InferParents(motions, garment->rig.hips);
  return garment;
}

}  // namespace

const converter::OpenModel& Garment::model(Precision precision) const {
  std::unique_ptr<converter::OpenModel>& model = models_[static_cast<size_t>(precision)];
  if (!model) model = MakeModel(*this, precision);
  return *model;
}

std::vector<std::string> GarmentNames() {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(DCLOTH_MODELS_DIR)) {
    const std::string name = entry.path().filename().string();
    if (fs::exists(entry.path() / (name + ".safetensors"))) names.push_back(name);
  }
  std::sort(names.begin(), names.end());
  return names;
}

const Garment& LoadGarment(const std::string& name) {
  static std::map<std::string, std::unique_ptr<Garment>> loaded;
  std::unique_ptr<Garment>& garment = loaded[name];
  if (!garment) garment = Read(name);
  return *garment;
}

}  // namespace dcloth::stability
