#include "converter/fold.h"

#include <Eigen/Dense>
#include <string>

#include "converter/error.h"
#include "engine/format/limits.h"

namespace dcloth::converter {

MatrixD FoldSkinWeights(const Bundle& bundle) {
  MatrixD sum = bundle.initial_weights.cast<double>();
  for (const Matrix& residual : bundle.residual_weights) sum += residual.cast<double>();
  sum = sum.cwiseMax(0.0);
  for (Eigen::Index i = 0; i < sum.rows(); ++i) {
    const double total = sum.row(i).sum();
    // Below this a normalised row is noise of the cancelled sum.
    if (!(total > 1e-6)) {
      throw Error({bundle.path, "static.residual_weights", "no positive skin weight for vertex " + std::to_string(i),
                   "max(W_I + sum W_i, 0) above 0 in every row", "train the static stage again"});
    }
    sum.row(i) /= total;
  }
  return sum;
}

MatrixD NormaliseRows(const Matrix& weights) {
  MatrixD rows = weights.cast<double>();
  for (Eigen::Index i = 0; i < rows.rows(); ++i) rows.row(i) /= rows.row(i).sum();
  return rows;
}

FoldedMeshLayer FoldMeshLayer(const MeshLayerWeights& layer) {
  const Eigen::Index width = layer.w.rows();
  MatrixD gates(width, 3 * width);
  gates << layer.w_z.cast<double>(), layer.w_r.cast<double>(), layer.w.cast<double>();
  FoldedMeshLayer folded;
  folded.input_gates = (layer.w_p.cast<double>() * gates).cast<float>();
  folded.gate_bias = (layer.b.cast<double>().transpose() * gates).transpose().cast<float>();
  folded.hidden_gates.resize(width, 2 * width);
  folded.hidden_gates << layer.u_z, layer.u_r;
  folded.hidden_candidate = layer.u;
  return folded;
}

JointSubset ChooseJoints(const Bundle& bundle, const PrunedWeights& body, const PrunedWeights& surface) {
  std::vector<bool> needed(bundle.joint_names.size(), false);
  needed[bundle.hips] = true;
  for (const uint32_t joint : bundle.feature_joints) needed[joint] = true;
  for (const uint32_t joint : bundle.bones) needed[joint] = true;
  for (const PrunedWeights* points : {&body, &surface}) {
    for (size_t i = 0; i < points->columns.size(); ++i) {
      if (points->weights[i] != 0) needed[points->columns[i]] = true;
    }
  }
  if (bundle.patches) {
    const PatchWeights& patches = *bundle.patches;
    for (const std::vector<uint32_t>* joints : {&patches.joints, &patches.capsule_joints, &patches.point_joints})
      for (const uint32_t joint : *joints) needed[joint] = true;
  }
  JointSubset subset;
  subset.kept.assign(needed.size(), JointSubset::kDropped);
  for (uint32_t joint = 0; joint < needed.size(); ++joint) {
    if (!needed[joint]) continue;
    subset.kept[joint] = static_cast<uint32_t>(subset.joints.size());
    subset.joints.push_back(joint);
  }
  // Body points and influences name joints in one byte.
  if (subset.joints.size() > 256) {
    throw Error({bundle.path, "", std::to_string(subset.joints.size()) + " joints that the garment needs",
                 "at most 256", "use fewer feature joints or bones"});
  }
  return subset;
}

std::vector<uint16_t> KeptParents(const Bundle& bundle, const JointSubset& subset) {
  std::vector<uint16_t> parents;
  for (const uint32_t joint : subset.joints) {
    int32_t above = bundle.parents[joint];
    const auto place = [&] { return subset.kept[static_cast<size_t>(above)]; };
    while (above >= 0 && place() == JointSubset::kDropped) above = bundle.parents[static_cast<size_t>(above)];
    parents.push_back(static_cast<uint16_t>(above < 0 ? format::kNoParent : place()));
  }
  return parents;
}

Matrix InverseBinds(const Bundle& bundle, std::span<const uint32_t> joints) {
  Matrix inverse(static_cast<Eigen::Index>(joints.size()), 12);
  for (size_t j = 0; j < joints.size(); ++j) {
    // Affine inverse: the last row stays 0 0 0 1 exactly.
    const Eigen::Matrix4d bind = bundle.bind[joints[j]].cast<double>();
    const Eigen::Matrix3d linear = bind.topLeftCorner<3, 3>().inverse();
    Eigen::Matrix<double, 3, 4, Eigen::RowMajor> rows;
    rows << linear, -linear * bind.topRightCorner<3, 1>();
    inverse.row(static_cast<Eigen::Index>(j)) = Eigen::Map<const Eigen::RowVectorXd>(rows.data(), 12).cast<float>();
  }
  if (!inverse.allFinite()) {
    throw Error({bundle.path, "character.bind", "a bind matrix whose inverse a float cannot hold",
                 "a bind pose in metres", "export the bundle again in metres"});
  }
  return inverse;
}

MatrixD BindPositions(const Bundle& bundle, std::span<const uint32_t> joints) {
  MatrixD positions(static_cast<Eigen::Index>(joints.size()), 3);
  for (size_t j = 0; j < joints.size(); ++j) {
    positions.row(static_cast<Eigen::Index>(j)) =
        bundle.bind[joints[j]].topRightCorner<3, 1>().cast<double>().transpose();
  }
  return positions;
}

StackedBasis StackBasis(const Bundle& bundle) {
  StackedBasis stacked;
  if (!bundle.skeleton) return stacked;
  const Eigen::Index k_s = bundle.skeleton->basis.rows();
  const Eigen::Index k_m = bundle.mesh ? bundle.mesh->basis.rows() : 0;
  const Eigen::Index skeleton_rows = k_s + k_s % 2, mesh_rows = k_m + k_m % 2;
  stacked.basis = Matrix::Zero(skeleton_rows + mesh_rows, bundle.skeleton->basis.cols());
  stacked.basis.topRows(k_s) = bundle.skeleton->basis;
  if (bundle.mesh) stacked.basis.middleRows(skeleton_rows, k_m) = bundle.mesh->basis;
  stacked.skeleton_rows = static_cast<uint32_t>(skeleton_rows);
  stacked.mesh_rows = static_cast<uint32_t>(mesh_rows);
  return stacked;
}

}  // namespace dcloth::converter
