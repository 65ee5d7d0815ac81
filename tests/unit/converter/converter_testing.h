// What the converter's tests share: random bundles (bundle_builder.h), what a call refuses, bundles of a known rank or
// body, and linear blend skinning in double.
#ifndef DCLOTH_TESTS_UNIT_CONVERTER_CONVERTER_TESTING_H_
#define DCLOTH_TESTS_UNIT_CONVERTER_CONVERTER_TESTING_H_

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "converter/bundle.h"
#include "converter/error.h"
#include "converter/fold.h"
#include "converter/rollout.h"
#include "converter/sequence.h"
#include "kernels/half.h"
#include "tests/unit/converter/bundle_builder.h"

namespace dcloth::converter {

using dcloth::testing::BuildBundle;
using dcloth::testing::BuildSequence;
using dcloth::testing::BundleSpec;
using dcloth::testing::ParseBundle;
using dcloth::testing::ParseRawBundle;
using dcloth::testing::ParseRawSequence;
using dcloth::testing::ParseSequence;
using dcloth::testing::RawFile;
using dcloth::testing::RawTensor;

// The text of the Error that the call throws, empty where it throws none. Anything else escapes and fails the test.
template <typename Call>
std::string ErrorText(Call&& call) {
  try {
    std::forward<Call>(call)();
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

// Why a bundle is refused; empty where it is taken.
inline std::string Refusal(const RawFile& raw) {
  return ErrorText([&] { ParseRawBundle(raw); });
}

// Whether the text holds every part; EXPECT_TRUE prints what is missing.
template <typename... Parts>
::testing::AssertionResult Mentions(std::string_view text, const Parts&... parts) {
  for (const std::string_view part : {std::string_view(parts)...}) {
    if (text.find(part) == std::string_view::npos) {
      return ::testing::AssertionFailure() << "'" << part << "' is not in '" << text << "'";
    }
  }
  return ::testing::AssertionSuccess();
}

inline Matrix AsHalves(const Matrix& matrix) {
  return matrix.unaryExpr([](float x) { return kernels::FloatFromHalf(kernels::HalfFromFloat(x)); });
}

// All rows of S and M become combinations of S's first `rank` rows; `halves` then rounds them as F16 bundles do. The
// mixing numbers are the same on every machine.
inline void LowerRank(Bundle* bundle, uint32_t rank, bool halves = false) {
  const MatrixD rows = bundle->skeleton->basis.topRows(rank).cast<double>();
  uint32_t state = 12345;
  const auto next = [&] {
    state = state * 1664525u + 1013904223u;  // Numerical Recipes' generator
    return static_cast<double>(state >> 8) * 0x1p-23 - 1;
  };
  const auto mix = [&](Matrix* basis, double size) {
    for (Eigen::Index j = 0; j < basis->rows(); ++j) {
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(rows.cols());
      for (uint32_t i = 0; i < rank; ++i) row += size * next() * rows.row(i);
      basis->row(j) = row.cast<float>();
    }
    if (halves) *basis = AsHalves(*basis);
  };
  mix(&bundle->skeleton->basis, 1.0);
  if (bundle->mesh) mix(&bundle->mesh->basis, 0.3);
}

// A face, by its vertices.
using Corners = std::array<uint32_t, 3>;

// A body that is a wall of `columns` x `rows` vertices, 0.05 m apart, along x through the template. Its left half hangs
// on the first bone, its right half on the first joint, which is no bone and needed by no one else.
inline Bundle WithWall(int columns, int rows) {
  const BundleSpec spec{.feature_joints = 1};
  Bundle bundle = ParseBundle(spec);
  const Eigen::Index b = Eigen::Index{columns} * rows, joints = bundle.body_joint_weights.cols();
  bundle.body_positions.resize(b, 3);
  bundle.body_joint_weights = Matrix::Zero(b, joints);
  std::vector<int32_t> corners;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int i = r * columns + c;
      bundle.body_positions.row(i) << 0.05f * static_cast<float>(c - columns / 2), 0.05f * static_cast<float>(r), 0.0f;
      bundle.body_joint_weights(i, c < columns / 2 ? bundle.bones[0] : 0) = 1;
      if (c + 1 < columns && r + 1 < rows) {
        corners.insert(corners.end(), {i, i + 1, i + columns + 1, i, i + columns + 1, i + columns});
      }
    }
  }
  bundle.body_faces = Eigen::Map<const Faces>(corners.data(), static_cast<Eigen::Index>(corners.size() / 3), 3);
  bundle.template_positions.rowwise() -= bundle.template_positions.row(0).eval();
  return bundle;
}

// G_j B_j^-1 of a joint in one frame. The sequence's joints are the bundle's.
inline Eigen::Matrix4d SkinMatrix(const Bundle& bundle, const Sequence& sequence, size_t frame, size_t joint) {
  const float* const rows = sequence.joint_matrices.data() + 16 * (frame * bundle.joint_names.size() + joint);
  const Eigen::Matrix4d world = Eigen::Map<const Eigen::Matrix<float, 4, 4, Eigen::RowMajor>>(rows).cast<double>();
  return world * bundle.bind[joint].cast<double>().inverse();
}

// World positions [n, 3] of one frame by all influences, v_i = sum_j w_ij G_j B_j^-1 T_i (NETWORK.md, static stage with
// D = 0 and delta = 0): the oracle for models whose networks are all zero.
inline MatrixD SkinFrame(const Bundle& bundle, const Sequence& sequence, size_t frame) {
  const MatrixD weights = FoldSkinWeights(bundle);
  MatrixD positions = MatrixD::Zero(weights.rows(), 3);
  for (size_t bone = 0; bone < bundle.bones.size(); ++bone) {
    const Eigen::Matrix4d skin = SkinMatrix(bundle, sequence, frame, bundle.bones[bone]);
    const MatrixD moved =
        (bundle.template_positions.cast<double>() * skin.topLeftCorner<3, 3>().transpose()).rowwise() +
        skin.topRightCorner<3, 1>().transpose();
    positions += (moved.array().colwise() * weights.col(static_cast<Eigen::Index>(bone)).array()).matrix();
  }
  return positions;
}

// Positions [frames, n, 3] of a whole sequence, one after another.
inline std::vector<float> Played(const OpenModel& model, const Sequence& sequence, uint32_t stages) {
  std::vector<float> all;
  Rollout(model, sequence, stages, [&](size_t, std::span<const float> positions, std::span<const float>) {
    all.insert(all.end(), positions.begin(), positions.end());
  });
  return all;
}

}  // namespace dcloth::converter

#endif  // DCLOTH_TESTS_UNIT_CONVERTER_CONVERTER_TESTING_H_
