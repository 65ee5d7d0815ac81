#include "converter/calibrate.h"

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "converter/error.h"
#include "converter/rollout.h"

namespace dcloth::converter {
namespace {

// Every vertex on the first bone: v = R (T + delta) + t, with R the bone's G B^-1.
OpenModel OneBoneModel(const Bundle& bundle, const FoldedBundle& folded) {
  FoldedBundle probe = folded;
  probe.reduced.reset();
  probe.skin.influences = 1;
  probe.skin.columns.assign(bundle.vertex_count(), 0);
  probe.skin.weights.assign(bundle.vertex_count(), 1.0f);
  return OpenModel(WriteModel(Assemble(bundle, probe, {})), bundle.path);
}

// R^-1 of the first bone per frame.
std::vector<Eigen::Matrix3d> InverseTurns(const Bundle& bundle, const Sequence& sequence) {
  const uint32_t joint = bundle.bones.front();
  const std::vector<uint32_t> map = MapJoints(sequence, std::vector<std::string>{bundle.joint_names[joint]});
  const Eigen::Matrix3d inverse_bind = bundle.bind[joint].cast<double>().inverse().topLeftCorner<3, 3>();
  std::vector<Eigen::Matrix3d> turns;
  std::vector<float> matrix(16);
  for (size_t frame = 0; frame < sequence.frame_count; ++frame) {
    GatherPose(sequence, frame, map, matrix);
    const Eigen::Map<const Eigen::Matrix<float, 4, 4, Eigen::RowMajor>> world(matrix.data());
    const Eigen::Matrix3d turn = world.cast<double>().topLeftCorner<3, 3>() * inverse_bind;
    if (!(std::abs(turn.determinant()) > 1e-9)) {
      throw Error({sequence.path, "joint_matrices",
                   "a collapsed joint '" + bundle.joint_names[joint] + "' in frame " + std::to_string(frame),
                   "invertible matrices", "leave this sequence out of --calibrate"});
    }
    turns.push_back(turn.inverse());
  }
  return turns;
}

}  // namespace

MatrixD DisplacementMoment(const Bundle& bundle, const FoldedBundle& folded, const BasisFrame& frame,
                           std::span<const Sequence> motion) {
  const OpenModel model = OneBoneModel(bundle, folded);
  std::vector<uint32_t> levels = {DCLOTH_STAGES_SKELETON};
  if (bundle.mesh) levels.push_back(DCLOTH_STAGES_MESH);
  MatrixD moment = MatrixD::Zero(frame.rank(), frame.rank());
  size_t samples = 0;
  for (const Sequence& sequence : motion) {
    const std::vector<Eigen::Matrix3d> turns = InverseTurns(bundle, sequence);
    // The static stage moves pivots and with them every vertex: its own level shows where delta is zero.
    std::vector<float> still;
    Rollout(model, sequence, DCLOTH_STAGES_STATIC,
            [&](size_t, std::span<const float> positions, std::span<const float>) {
              still.insert(still.end(), positions.begin(), positions.end());
            });
    for (const uint32_t level : levels) {
      Rollout(model, sequence, level, [&](size_t t, std::span<const float> positions, std::span<const float>) {
        const auto columns = static_cast<Eigen::Index>(positions.size());
        const VectorD moved = Eigen::Map<const Vector>(positions.data(), columns).cast<double>() -
                              Eigen::Map<const Vector>(still.data() + t * positions.size(), columns).cast<double>();
        Eigen::Matrix3Xd delta = turns[t] * Eigen::Map<const Eigen::Matrix3Xd>(moved.data(), 3, columns / 3);
        const VectorD coordinates = frame.directions * Eigen::Map<const VectorD>(delta.data(), columns);
        moment.selfadjointView<Eigen::Lower>().rankUpdate(coordinates);
        ++samples;
      });
    }
  }
  return MatrixD(moment.selfadjointView<Eigen::Lower>()) / static_cast<double>(std::max<size_t>(1, samples));
}

}  // namespace dcloth::converter
