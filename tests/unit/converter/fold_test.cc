#include "converter/fold.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

constexpr double kHalfUlp = 0x1p-24;  // relative rounding of a float

TEST(FoldTest, SkinWeightsAreTheNormalisedClampedSum) {
  for (const uint32_t residuals : {0u, 1u, 5u}) {
    const BundleSpec spec{.residuals = residuals};
    const Bundle bundle = ParseBundle(spec);
    const MatrixD folded = FoldSkinWeights(bundle);
    for (Eigen::Index i = 0; i < folded.rows(); ++i) {
      std::vector<double> row;
      double total = 0;
      for (Eigen::Index j = 0; j < folded.cols(); ++j) {
        double sum = static_cast<double>(bundle.initial_weights(i, j));
        for (const Matrix& residual : bundle.residual_weights) sum += static_cast<double>(residual(i, j));
        row.push_back(std::max(sum, 0.0));
        total += row.back();
      }
      for (Eigen::Index j = 0; j < folded.cols(); ++j) {
        ASSERT_NEAR(folded(i, j), row[static_cast<size_t>(j)] / total, 1e-15);  // some roundings of values up to 1
      }
    }
  }
}

TEST(FoldTest, VertexWithoutWeightIsRefused) {
  BundleSpec spec;
  RawFile raw = BuildBundle(spec);
  for (uint32_t j = 0; j < spec.bones; ++j) {
    raw.SetFloat("static.initial_weights", 5 * spec.bones + j, -10);
  }
  EXPECT_TRUE(
      Mentions(ErrorText([&] { FoldSkinWeights(ParseRawBundle(raw)); }), "no positive skin weight for vertex 5"));
}

// Sums of three floats hold any double.
TEST(FoldTest, ASumOfAMillionthIsNoneAndTheNextDoubleIsOne) {
  Bundle bundle = ParseBundle({});
  ASSERT_EQ(bundle.residual_weights.size(), 2u);
  const auto refusal = [&](double total) {
    double rest = total;
    for (Matrix* part : {&bundle.initial_weights, &bundle.residual_weights[0], &bundle.residual_weights[1]}) {
      part->row(3).setZero();
      (*part)(3, 1) = static_cast<float>(rest);
      rest -= static_cast<double>((*part)(3, 1));
    }
    EXPECT_EQ(rest, 0);
    return ErrorText([&] { FoldSkinWeights(bundle); });
  };
  EXPECT_TRUE(Mentions(refusal(1e-6), "no positive skin weight for vertex 3"));
  EXPECT_EQ(refusal(std::nextafter(1e-6, 1)), "");
}

// The folded layer's pre-activations against the unfolded formula, both in double, on random inputs.
TEST(FoldTest, MeshLayerGivesTheSamePreActivations) {
  const BundleSpec spec{.feature_width = 16};
  const Bundle bundle = ParseBundle(spec);
  for (const MeshLayerWeights& layer : bundle.mesh->layers) {
    const FoldedMeshLayer folded = FoldMeshLayer(layer);
    const Eigen::Index inputs = layer.w_p.rows(), width = layer.w.rows();
    ASSERT_EQ(folded.input_gates.rows(), inputs);
    ASSERT_EQ(folded.input_gates.cols(), 3 * width);
    MatrixD mean = MatrixD::Random(20, inputs);  // the mean of x over N(i); any values will do
    const MatrixD a = (mean * layer.w_p.cast<double>()).rowwise() + layer.b.cast<double>().transpose();
    const Matrix* gates[] = {&layer.w_z, &layer.w_r, &layer.w};
    const MatrixD got =
        (mean * folded.input_gates.cast<double>()).rowwise() + folded.gate_bias.cast<double>().transpose();
    for (int gate = 0; gate < 3; ++gate) {
      const MatrixD expected = a * gates[gate]->cast<double>();
      for (Eigen::Index i = 0; i < expected.rows(); ++i) {
        for (Eigen::Index c = 0; c < width; ++c) {
          const Eigen::Index column = gate * width + c;
          // Only the folded matrices were rounded, each entry by half an ulp.
          const double bound =
              kHalfUlp * (mean.row(i).cwiseAbs() * folded.input_gates.col(column).cast<double>().cwiseAbs()).value() +
              kHalfUlp * std::abs(static_cast<double>(folded.gate_bias[column])) + 1e-13;
          ASSERT_LE(std::abs(got(i, column) - expected(i, c)), bound);
        }
      }
    }
    EXPECT_EQ(folded.hidden_gates.leftCols(width), layer.u_z);
    EXPECT_EQ(folded.hidden_gates.rightCols(width), layer.u_r);
    EXPECT_EQ(folded.hidden_candidate, layer.u);
  }
}

TEST(FoldTest, KeepsExactlyTheJointsThatAreNeeded) {
  const BundleSpec spec{.joints = 12, .feature_joints = 2, .bones = 3};
  Bundle bundle = ParseBundle(spec);
  EXPECT_EQ(ChooseJoints(bundle, {}).joints, (std::vector<uint32_t>{0, 1, 9, 10, 11}));
  PrunedWeights body{2, {4, 5, 9, 6}, {0.5f, 0.5f, 1, 0}};
  const JointSubset subset = ChooseJoints(bundle, body);
  EXPECT_EQ(subset.joints, (std::vector<uint32_t>{0, 1, 4, 5, 9, 10, 11}));  // 6 has no weight
  EXPECT_EQ(subset.kept[9], 4u);
  EXPECT_EQ(subset.kept[6], JointSubset::kDropped);
  bundle.hips = 7;
  EXPECT_EQ(ChooseJoints(bundle, {}).joints, (std::vector<uint32_t>{0, 1, 7, 9, 10, 11}));
}

TEST(FoldTest, PassesOverJointsThatAreNotKept) {
  const BundleSpec spec{.joints = 12, .feature_joints = 2, .bones = 3};
  Bundle bundle = ParseBundle(spec);
  // Kept are 0, 1, 9, 10, 11. Above 9 stand 8 and 7, then 1; above 10 stands 2 alone; 1 stands above 0.
  bundle.parents = {1, -1, -1, 0, 0, 0, 0, 1, 7, 8, 2, 9};
  const JointSubset subset = ChooseJoints(bundle, {});
  ASSERT_EQ(subset.joints, (std::vector<uint32_t>{0, 1, 9, 10, 11}));
  EXPECT_EQ(KeptParents(bundle, subset), (std::vector<uint16_t>{1, 65535, 1, 65535, 2}));
}

TEST(FoldTest, MoreThan256JointsAreRefused) {
  const BundleSpec spec{.joints = 300, .feature_joints = 1, .bones = 256, .skeleton = false, .mesh = false};
  Bundle bundle = ParseBundle(spec);  // hips and one feature joint 0, bones 44 to 299
  EXPECT_TRUE(Mentions(ErrorText([&] { ChooseJoints(bundle, {}); }), "257 joints"));
  bundle.bones.pop_back();
  EXPECT_EQ(ChooseJoints(bundle, {}).joints.size(), 256u);
}

TEST(FoldTest, InverseBindsInvert) {
  const Bundle bundle = ParseBundle({});
  const std::vector<uint32_t> joints = {5, 0, 3};
  const Matrix inverse = InverseBinds(bundle, joints);
  for (size_t j = 0; j < joints.size(); ++j) {
    Eigen::Matrix4d rows = Eigen::Matrix4d::Identity();
    for (int i = 0; i < 12; ++i) rows(i / 4, i % 4) = static_cast<double>(inverse(static_cast<Eigen::Index>(j), i));
    const Eigen::Matrix4d bind = bundle.bind[joints[j]].cast<double>();
    // Entries of the inverse are at most 2 here, each rounded by half an ulp, and a product sums four of them.
    const double bound = 4 * 2 * kHalfUlp * bind.cwiseAbs().maxCoeff();
    EXPECT_LE((rows * bind - Eigen::Matrix4d::Identity()).cwiseAbs().maxCoeff(), bound);
    EXPECT_EQ(BindPositions(bundle, joints).row(static_cast<Eigen::Index>(j)).transpose(),
              (bind.topRightCorner<3, 1>()));
  }
}

TEST(FoldTest, BasisIsStackedWithEvenRows) {
  BundleSpec spec;
  for (const auto& [skeleton, mesh] : {std::pair(5u, 4u), {4u, 5u}, {7u, 9u}, {2u, 6u}}) {
    spec.skeleton_basis = skeleton;
    spec.mesh_basis = mesh;
    const Bundle bundle = ParseBundle(spec);
    const StackedBasis stacked = StackBasis(bundle);
    EXPECT_EQ(stacked.skeleton_rows, (skeleton + 1) / 2 * 2);
    EXPECT_EQ(stacked.mesh_rows, (mesh + 1) / 2 * 2);
    ASSERT_EQ(stacked.basis.rows(), stacked.skeleton_rows + stacked.mesh_rows);
    EXPECT_EQ(stacked.basis.topRows(skeleton), bundle.skeleton->basis);
    EXPECT_EQ(stacked.basis.middleRows(stacked.skeleton_rows, mesh), bundle.mesh->basis);
    for (Eigen::Index row = skeleton; row < stacked.skeleton_rows; ++row) EXPECT_TRUE(stacked.basis.row(row).isZero(0));
    EXPECT_TRUE(stacked.basis.bottomRows(mesh % 2).isZero(0));
  }
  spec.mesh = false;
  EXPECT_EQ(StackBasis(ParseBundle(spec)).mesh_rows, 0u);
}

TEST(FoldTest, NormalisedRowsSumToOne) {
  Matrix weights(3, 2);
  weights << 1, 3, 0.5f, 0, 2, 2;
  MatrixD expected(3, 2);
  expected << 0.25, 0.75, 1, 0, 0.5, 0.5;
  EXPECT_EQ(NormaliseRows(weights), expected);
}

}  // namespace
}  // namespace dcloth::converter
