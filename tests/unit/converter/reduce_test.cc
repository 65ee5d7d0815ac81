#include "converter/reduce.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>

#include "converter/error.h"
#include "converter/fold.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

constexpr uint32_t kRows = 17;  // k_S + k_M of BundleSpec

MatrixD Stacked(const Bundle& bundle) {
  const Eigen::Index k_s = bundle.skeleton->basis.rows(), k_m = bundle.mesh ? bundle.mesh->basis.rows() : 0;
  MatrixD stacked(k_s + k_m, bundle.skeleton->basis.cols());
  stacked.topRows(k_s) = bundle.skeleton->basis.cast<double>();
  if (bundle.mesh) stacked.bottomRows(k_m) = bundle.mesh->basis.cast<double>();
  return stacked;
}

TEST(BasisRankTest, FindsTheRankBehindFloatsAndHalves) {
  for (const uint32_t rank : {1u, 4u, 9u}) {
    for (const bool halves : {false, true}) {
      Bundle bundle = ParseBundle({});
      LowerRank(&bundle, rank, halves);
      const BasisRank found(bundle);
      EXPECT_EQ(found.rank(), rank) << halves;
      EXPECT_EQ(found.rows(), kRows);
      const BasisFrame frame = found.Frame();
      const MatrixD rest = Stacked(bundle) - frame.coordinates * frame.directions;
      const double tolerance = halves ? 0x1p-11 : std::sqrt(kRows) * 0x1p-24;
      for (Eigen::Index j = 0; j < rest.rows(); ++j)
        EXPECT_LE(rest.row(j).norm(), 1.0001 * tolerance * Stacked(bundle).row(j).norm()) << "row " << j;
      const MatrixD gram = frame.directions * frame.directions.transpose();
      EXPECT_LT((gram - MatrixD::Identity(rank, rank)).cwiseAbs().maxCoeff(), 1e-9);
    }
  }
  EXPECT_EQ(BasisRank(ParseBundle({})).rank(), kRows);
  const BundleSpec wide{.skeleton_basis = 6, .mesh_basis = 11};
  Bundle bundle = ParseBundle(wide);
  LowerRank(&bundle, 4);
  EXPECT_EQ(BasisRank(bundle).rank(), 4u) << "more rows below than above";
}

// What halves cannot hold is noise in a half-float bundle and a direction of its own in a float one. A row that is
// small beside all others is judged by its own length.
TEST(BasisRankTest, ToleranceIsThatOfTheStoredNumbers) {
  Bundle bundle = ParseBundle({});
  LowerRank(&bundle, 4);
  const Matrix other = ParseBundle({.seed = 9}).skeleton->basis;
  Bundle tilted = bundle;
  tilted.skeleton->basis.row(3) += 1e-4f * other.row(0);
  EXPECT_EQ(BasisRank(tilted).rank(), 5u);
  Bundle halves = tilted;
  for (Matrix* basis : {&halves.skeleton->basis, &halves.mesh->basis}) *basis = AsHalves(*basis);
  EXPECT_EQ(BasisRank(halves).rank(), 4u);
  Bundle small = bundle;
  small.mesh->basis.row(2) = 1e-5f * other.row(1);
  EXPECT_EQ(BasisRank(small).rank(), 5u);
}

TEST(BasisRankTest, OddBases) {
  Bundle zero = ParseBundle({});
  zero.skeleton->basis.setZero();
  zero.mesh->basis.setZero();
  const BasisRank rank(zero);
  EXPECT_EQ(rank.rank(), 1u);
  const BasisFrame frame = rank.Frame();
  const ReducedBasis reduced = Reduce(zero, frame, ExpectedMoment(frame), 1);
  EXPECT_TRUE(reduced.head.allFinite() && reduced.basis.isZero() && reduced.coefficients.weight.allFinite());

  BundleSpec spec;
  spec.vertices = 9;  // 27 columns, fewer than rows
  spec.skeleton_basis = 40;
  EXPECT_EQ(BasisRank(ParseBundle(spec)).rank(), 27u);
  spec.skeleton_basis = BasisRank::kMostRows;
  const Bundle many = ParseBundle(spec);
  const BasisRank large(many);
  EXPECT_EQ(large.rank(), large.rows());
  EXPECT_TRUE(Mentions(ErrorText([&] { large.Frame(); }), "2055 rows", "2048", "--rank full"));
}

// Every coefficient's path through head and basis gives back the row it stood for, and W_2 folded with H_M the same
// displacement as W_2 and M, whatever the moment that chose the directions.
TEST(ReduceTest, AtTheNumericalRankNothingChanges) {
  for (const bool mesh : {true, false}) {
    const BundleSpec spec{.mesh = mesh};
    Bundle bundle = ParseBundle(spec);
    LowerRank(&bundle, 5);
    const BasisFrame frame = BasisRank(bundle).Frame();
    ASSERT_EQ(frame.rank(), 5u);
    MatrixD lopsided = MatrixD::Zero(5, 5);
    lopsided.diagonal() << 1e4, 1, 1e-3, 1e-12, 0;
    for (const MatrixD& moment : {ExpectedMoment(frame), lopsided}) {
      const ReducedBasis reduced = Reduce(bundle, frame, moment, 5);
      ASSERT_EQ(reduced.basis.rows(), 6);  // even: the last is zero
      EXPECT_TRUE(reduced.basis.row(5).isZero() && reduced.head.col(5).isZero());
      const MatrixD skeleton = reduced.head.cast<double>() * reduced.basis.cast<double>();
      const MatrixD& expected = bundle.skeleton->basis.cast<double>();
      // Five products of floats, each factor rounded once, and what the rank leaves out.
      const MatrixD sizes = reduced.head.cast<double>().cwiseAbs() * reduced.basis.cast<double>().cwiseAbs();
      for (Eigen::Index j = 0; j < expected.rows(); ++j) {
        const double left_out = std::sqrt(kRows) * 0x1p-24 * expected.row(j).norm();
        const VectorD error = (skeleton.row(j) - expected.row(j)).cwiseAbs();
        const VectorD bound = 2.01 * 0x1p-24 * sizes.row(j).array() + 1.01 * left_out;
        EXPECT_TRUE((error.array() <= bound.array()).all()) << "row " << j << ": " << error.maxCoeff();
      }
      if (!mesh) {
        EXPECT_EQ(reduced.coefficients.weight.size(), 0);
        continue;
      }
      const LinearWeights& full = bundle.mesh->coefficients;
      const MatrixD m = bundle.mesh->basis.cast<double>();
      const MatrixD before = full.weight.cast<double>().transpose() * m;
      const MatrixD after = reduced.coefficients.weight.cast<double>().transpose() * reduced.basis.cast<double>();
      const MatrixD folded_sizes =
          reduced.coefficients.weight.cast<double>().cwiseAbs().transpose() * reduced.basis.cast<double>().cwiseAbs();
      const double row_error = std::sqrt(kRows) * 0x1p-24 * m.rowwise().norm().maxCoeff();
      const double left_out = row_error * full.weight.cast<double>().cwiseAbs().colwise().sum().maxCoeff();
      EXPECT_TRUE(
          ((after - before).cwiseAbs().array() <= 2.01 * 0x1p-24 * folded_sizes.array() + 1.01 * left_out).all());
      const VectorD bias = full.bias.cast<double>().transpose() * m;
      const VectorD folded_bias = reduced.coefficients.bias.cast<double>().transpose() * reduced.basis.cast<double>();
      EXPECT_LT((bias - folded_bias).norm(), 1e-6 * bias.norm());
    }
  }
}

// Eckart and Young: over displacements with a given second moment, no other basis of r rows loses less than the sum of
// the moment's smallest eigenvalues, and this one loses just that.
TEST(ReduceTest, LosesTheLeastThatRankAllows) {
  const Bundle bundle = ParseBundle({});
  const BasisFrame frame = BasisRank(bundle).Frame();
  ASSERT_EQ(frame.rank(), kRows);
  // Samples of [P; Q] of very different sizes.
  MatrixD samples(40, kRows);
  for (Eigen::Index t = 0; t < samples.rows(); ++t) {
    for (Eigen::Index j = 0; j < samples.cols(); ++j)
      samples(t, j) = std::sin(0.37 * static_cast<double>(t * (j + 2)) + static_cast<double>(j)) / (1.0 + 0.4 * j);
  }
  const MatrixD y = samples * frame.coordinates;
  const MatrixD moment = y.transpose() * y / static_cast<double>(samples.rows());
  const VectorD values = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(moment)).eigenvalues();
  const Eigen::Index k_s = bundle.skeleton->basis.rows();
  const MatrixD full = samples * Stacked(bundle);
  for (const uint32_t rank : {2u, 6u, 12u}) {
    const ReducedBasis reduced = Reduce(bundle, frame, moment, rank);
    // H_M is W_2's fold with W_2 at identity.
    Bundle plain = bundle;
    plain.mesh->coefficients.weight = Matrix::Identity(7, 7);
    const Matrix mesh_head = Reduce(plain, frame, moment, rank).coefficients.weight.transpose();
    const MatrixD c =
        samples.leftCols(k_s) * reduced.head.cast<double>() + samples.rightCols(7) * mesh_head.cast<double>();
    const double lost = (full - c * reduced.basis.cast<double>()).squaredNorm() / static_cast<double>(full.rows());
    const double least = values.head(kRows - rank).sum();
    // Float storage rounds by 2^-24 of a displacement that is at most 17 times as large as its parts' root.
    EXPECT_NEAR(lost, least, 1e-5 * least + 1e-12 * values.sum()) << rank;
    const VectorD sizes = c.cwiseAbs2().colwise().mean();
    EXPECT_LT((sizes.array() - 1).abs().maxCoeff(), 1e-4) << "coefficients have mean square 1";
  }
}

TEST(ReduceTest, SavesOnlyWhereHeadAndWiderMeshStageCostLess) {
  BundleSpec spec;
  const Bundle bundle = ParseBundle(spec);
  // [S; M]: 18 rows of 192 padded columns and a mesh MLP of 16 x 32: 3968. Rank 16: 16 x 192 + 16 x 32 + 10 x 32 =
  // 3904.
  EXPECT_TRUE(ReductionSaves(bundle, 16, Precision::kFp32));
  EXPECT_TRUE(ReductionSaves(bundle, 15, Precision::kFp16));
  EXPECT_FALSE(ReductionSaves(bundle, 17, Precision::kFp32));
  // In int8 the head's fp16 weighs double: 4224 against 3968.
  EXPECT_FALSE(ReductionSaves(bundle, 16, Precision::kInt8));
  EXPECT_TRUE(ReductionSaves(bundle, 14, Precision::kInt8));

  // Without a mesh stage nothing but the head is added: 10 rows of 192 columns, none of them less.
  spec.mesh = false;
  EXPECT_FALSE(ReductionSaves(ParseBundle(spec), 10, Precision::kFp32));
  // 16 rows of 64 against 8 of them and 15 x 32: 1024 and 992.
  spec.vertices = 20;
  spec.skeleton_basis = 15;
  EXPECT_TRUE(ReductionSaves(ParseBundle(spec), 8, Precision::kFp32));
  spec.skeleton_basis = 16;
  EXPECT_FALSE(ReductionSaves(ParseBundle(spec), 8, Precision::kFp32)) << "1024 either way";
}

}  // namespace
}  // namespace dcloth::converter
