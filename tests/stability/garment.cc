#include "tests/stability/garment.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <limits>
#include <map>

#include "converter/convert.h"
#include "converter/error.h"
#include "converter/file.h"

namespace dcloth::stability {
namespace {

Matrix Yaw(double radians) {
  Matrix matrix = Matrix::Identity();
  matrix.topLeftCorner<3, 3>() = Eigen::AngleAxisd(radians, Eigen::Vector3d::UnitY()).toRotationMatrix();
  return matrix;
}

Matrix Translation(const Eigen::Vector3d& offset) {
  Matrix matrix = Matrix::Identity();
  matrix.topRightCorner<3, 1>() = offset;
  return matrix;
}

Eigen::Vector3d OriginOf(const Matrix& matrix) { return matrix.topRightCorner<3, 1>(); }

// The angle is clamped to half a turn: beyond it a rotation comes back from the other side.
Eigen::Matrix3d Multiplied(const Eigen::Matrix3d& rotation, double factor) {
  Eigen::AngleAxisd turn(rotation);
  turn.angle() = std::min(factor * turn.angle(), 3.1415);
  return turn.toRotationMatrix();
}

// A joint against its parent, the hips against the ground frame: pose, rest rotation, and the rotation between them.
struct AgainstParent {
  Matrix local;
  Eigen::Matrix3d rest, turn;
};

AgainstParent OfJoint(const Pose& pose, const Rig& rig, const Matrix& ground, size_t joint) {
  const bool root = joint == rig.hips;
  const size_t parent = rig.parents[joint];
  const Matrix rest = root ? rig.bind[joint] : Matrix(rig.bind[parent].inverse() * rig.bind[joint]);
  const Matrix local = (root ? ground : pose[parent]).inverse() * pose[joint];
  const Eigen::Matrix3d rotation = rest.topLeftCorner<3, 3>();
  return {local, rotation, local.topLeftCorner<3, 3>() * rotation.transpose()};
}

// The largest distance of the child's origin in the parent's frame from where it is in the first frame.
double Wander(const std::vector<const Motion*>& motions, size_t child, size_t parent) {
  const auto local = [&](const Pose& pose) { return OriginOf(pose[parent].inverse() * pose[child]); };
  const Eigen::Vector3d first = local(motions.front()->front());
  double wander = 0;
  for (const Motion* motion : motions) {
    for (const Pose& pose : *motion) wander = std::max(wander, (local(pose) - first).norm());
  }
  return wander;
}

}  // namespace

std::vector<size_t> InferParents(const std::vector<const Motion*>& motions, size_t hips) {
  const size_t joints = motions.front()->front().size();
  std::vector<size_t> parents(joints, hips), tree = {hips};
  std::vector<bool> attached(joints, false);
  attached[hips] = true;
  while (tree.size() < joints) {
    double best = std::numeric_limits<double>::infinity();
    size_t child = 0, parent = 0;
    for (size_t j = 0; j < joints; ++j) {
      if (attached[j]) continue;
      for (const size_t p : tree) {
        const double wander = Wander(motions, j, p);
        if (wander < best) best = wander, child = j, parent = p;
      }
    }
    attached[child] = true;
    parents[child] = parent;
    tree.push_back(child);
  }
  return parents;
}

Pose Turned(const Pose& pose, const Rig& rig, double radians) {
  const Eigen::Vector3d pivot = OriginOf(pose[rig.hips]);
  const Matrix turn = Translation(pivot) * Yaw(radians) * Translation(-pivot);
  Pose turned;
  for (const Matrix& joint : pose) turned.push_back(turn * joint);
  return turned;
}

Pose Moved(const Pose& pose, const Eigen::Vector3d& offset) {
  Pose moved;
  for (const Matrix& joint : pose) moved.push_back(Translation(offset) * joint);
  return moved;
}

double LargestTurn(const Pose& pose, const Rig& rig) {
  const Matrix ground = GroundFrame(pose, rig);
  double largest = 0;
  for (size_t j = 0; j < pose.size(); ++j)
    largest = std::max(largest, Eigen::AngleAxisd(OfJoint(pose, rig, ground, j).turn).angle());
  return largest;
}

Pose Exaggerated(const Pose& pose, const Rig& rig, double factor) {
  const Matrix ground = GroundFrame(pose, rig);
  // Parents come before their children, whatever order the joints have.
  std::vector<size_t> depth(pose.size(), 0), order(pose.size());
  for (size_t j = 0; j < pose.size(); ++j) {
    order[j] = j;
    for (size_t p = j; p != rig.hips; p = rig.parents[p]) ++depth[j];
  }
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return depth[a] < depth[b]; });

  Pose out(pose.size());
  for (const size_t j : order) {
    const AgainstParent joint = OfJoint(pose, rig, ground, j);
    Matrix scaled = joint.local;
    scaled.topLeftCorner<3, 3>() = Multiplied(joint.turn, factor) * joint.rest;
    out[j] = (j == rig.hips ? ground : out[rig.parents[j]]) * scaled;
  }
  return out;
}

Pose Deformed(const Pose& pose, const Eigen::Matrix3d& linear) {
  Pose deformed = pose;
  for (Matrix& joint : deformed) joint.topLeftCorner<3, 3>() *= linear;
  return deformed;
}

Matrix GroundFrame(const Pose& pose, const Rig& rig) {
  const Matrix bound = pose[rig.hips] * rig.bind[rig.hips].inverse();
  const Eigen::Vector3d origin = OriginOf(pose[rig.hips]);
  return Translation({origin[0], 0, origin[2]}) * Yaw(std::atan2(-bound(2, 0), bound(0, 0)));
}

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
