// Linear blend skinning of a bundle's static stage in double: the oracle for models whose networks are all zero.
// v_i = sum_j w_ij G_j B_j^-1 T_i (NETWORK.md, static stage with D = 0 and delta = 0).
#ifndef DCLOTH_TESTS_UNIT_CONVERTER_SKINNING_REFERENCE_H_
#define DCLOTH_TESTS_UNIT_CONVERTER_SKINNING_REFERENCE_H_

#include <Eigen/Dense>
#include <vector>

#include "converter/bundle.h"
#include "converter/fold.h"
#include "converter/sequence.h"

namespace dcloth::testing {

// World positions [n, 3] of one frame with all influences.
inline converter::MatrixD SkinFrame(const converter::Bundle& bundle, const converter::Sequence& sequence,
                                    size_t frame) {
  const converter::MatrixD weights = converter::FoldSkinWeights(bundle);
  converter::MatrixD positions = converter::MatrixD::Zero(weights.rows(), 3);
  for (size_t bone = 0; bone < bundle.bones.size(); ++bone) {
    const size_t joint = bundle.bones[bone];  // the sequence's joints are the bundle's
    Eigen::Matrix4d world;
    for (int i = 0; i < 16; ++i) {
      world(i / 4, i % 4) = static_cast<double>(
          sequence.joint_matrices[(frame * bundle.joint_names.size() + joint) * 16 + static_cast<size_t>(i)]);
    }
    const Eigen::Matrix4d skin = world * bundle.bind[joint].cast<double>().inverse();
    const converter::MatrixD moved =
        (bundle.template_positions.cast<double>() * skin.topLeftCorner<3, 3>().transpose()).rowwise() +
        skin.topRightCorner<3, 1>().transpose();
    positions += (moved.array().colwise() * weights.col(static_cast<Eigen::Index>(bone)).array()).matrix();
  }
  return positions;
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_CONVERTER_SKINNING_REFERENCE_H_
