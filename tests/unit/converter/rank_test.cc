#include "converter/rank.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "converter/calibrate.h"
#include "converter/correct.h"
#include "converter/fold.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

TEST(SmallestGoodRankTest, FindsEveryThresholdInFewCalls) {
  for (uint32_t top = 2; top <= 130; top += 2) {
    for (uint32_t threshold = 2; threshold <= top; ++threshold) {
      double calls = 0;
      const uint32_t found = SmallestGoodRank(top, [&](uint32_t rank) {
        EXPECT_TRUE(rank % 2 == 0 && rank >= 2 && rank < top);
        ++calls;
        return rank >= threshold;
      });
      EXPECT_EQ(found, StoredRank(threshold));
      EXPECT_LE(calls, std::ceil(std::log2(top)));
    }
  }
}

// A gated unit without inputs whose update gate is closed and whose candidate is tanh(b): P is the same in every frame,
// and the moment follows by hand, the turning and walking character notwithstanding.
TEST(DisplacementMomentTest, AgreesWithAKnownDisplacement) {
  const BundleSpec spec{.mesh = false};
  Bundle bundle = ParseBundle(spec);
  SkeletonWeights& skeleton = *bundle.skeleton;
  const Eigen::Index k = skeleton.basis.rows();
  for (LinearWeights* linear : {&skeleton.input, &skeleton.hidden}) {
    linear->weight.setZero();
    linear->bias.setZero();
  }
  VectorD p(k);
  for (Eigen::Index j = 0; j < k; ++j) {
    skeleton.input.bias[k + j] = -30;
    skeleton.input.bias[2 * k + j] = 0.2f * static_cast<float>(j - 4);
    p[j] = std::tanh(static_cast<double>(skeleton.input.bias[2 * k + j]));
  }
  const std::vector<Sequence> motion = {ParseSequence(spec, 20)};
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  const BasisFrame frame = BasisRank(bundle).Frame();
  const MatrixD moment = DisplacementMoment(bundle, folded, frame, motion);
  const VectorD y = frame.coordinates.transpose() * p;
  // Vertices within 4 m pass through 40 roundings in each of two levels (see PlainSkinningAgreesWithDouble), turning
  // back mixes three coordinates, and directions have length 1.
  const double coordinate_error = std::sqrt(3.0) * 2 * 40 * 4 * 0x1p-24;
  const double error = std::sqrt(static_cast<double>(frame.directions.cols())) * coordinate_error;
  EXPECT_LT((moment - y * y.transpose()).norm(), 2 * y.norm() * error + error * error);
  EXPECT_GT(y.squaredNorm(), 20 * (2 * y.norm() * error + error * error)) << "the bound would pass zero";
}

// Of one frame it is that frame's own; a bone without inverse leaves nothing to turn back by.
TEST(DisplacementMomentTest, IsAMeanOverFramesWhoseBonesHaveAnInverse) {
  const BundleSpec spec{.mesh = false};
  Bundle bundle = ParseBundle(spec);
  bundle.bind[bundle.bones[0]].setIdentity();
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  const BasisFrame frame = BasisRank(bundle).Frame();
  std::vector<Sequence> motion = {ParseSequence(spec, 1)};
  const double once = DisplacementMoment(bundle, folded, frame, motion).trace();
  ASSERT_GT(once, 0);
  motion.push_back(motion[0]);
  motion.push_back(motion[0]);
  EXPECT_NEAR(DisplacementMoment(bundle, folded, frame, motion).trace(), once, 1e-12 * once);

  motion = {ParseSequence(spec, 3)};
  // The first bone's rotation in the last frame gets this determinant, to the last bit of a double.
  const auto refusal = [&](double determinant) {
    const auto high = static_cast<float>(determinant);
    const auto middle = static_cast<float>(determinant - static_cast<double>(high));
    const double rest = determinant - static_cast<double>(high) - static_cast<double>(middle);
    const auto low = static_cast<float>(rest);
    EXPECT_EQ(static_cast<double>(low), rest);
    const float rows[16] = {1, low, 0, 0, -1, high, middle, 0, 0, -1, 1, 0, 0, 0, 0, 1};
    float* const matrix = motion[0].joint_matrices.data() + (2 * spec.joints + bundle.bones[0]) * 16;
    std::copy_n(rows, 16, matrix);
    return ErrorText([&] { DisplacementMoment(bundle, folded, frame, motion); });
  };
  for (const double determinant : {0.0, 1e-9, -1e-9}) {
    EXPECT_EQ(refusal(determinant),
              "s.safetensors: tensor joint_matrices: found a collapsed joint 'joint_2' in frame 2, expected invertible "
              "matrices; leave this sequence out of --calibrate");
  }
  EXPECT_EQ(refusal(std::nextafter(1e-9, 1)), "");
  EXPECT_EQ(refusal(std::nextafter(-1e-9, -1)), "");
}

// Half of the moment is the skeleton stage's own: a mesh stage that cancels it must not drop its directions.
TEST(DisplacementMomentTest, KeepsBothLevels) {
  Bundle bundle = ParseBundle({});
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  const BasisFrame frame = BasisRank(bundle).Frame();
  const std::vector<Sequence> motion = {ParseSequence({}, 20)};
  const MatrixD both = DisplacementMoment(bundle, folded, frame, motion);
  bundle.mesh->basis.setZero();
  const MatrixD skeleton = DisplacementMoment(bundle, folded, frame, motion);
  EXPECT_GT((both - skeleton).norm(), 1e-3 * skeleton.norm()) << "the mesh stage shows";
  const double least =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(both - 0.5 * skeleton)).eigenvalues().minCoeff();
  EXPECT_GE(least, -1e-6 * skeleton.norm());
}

// 48 + 16 rows of rank 44, enough for an int8 basis to trade some of them.
Bundle OfRank44(uint32_t vertices) {
  const BundleSpec spec{.vertices = vertices, .skeleton_basis = 48, .mesh_basis = 16};
  Bundle bundle = ParseBundle(spec);
  LowerRank(&bundle, 44);
  return bundle;
}

// Without motion an int8 basis keeps a share of the rounding of the whole one, by remainders: one row in twenty has one
// at most. Floats round little and need none.
TEST(RankMakerTest, WithoutMotionRowsGetRemainders) {
  const Bundle bundle = OfRank44(120);
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  RankMaker maker(bundle, folded, {});
  ASSERT_EQ(maker.exact_rank(), 44u);
  const ReducedBasis rounded = *maker.Make(44, Precision::kInt8);
  EXPECT_EQ(rounded.basis.rows(), 44);
  EXPECT_EQ(rounded.corrected.size(), 2u);
  EXPECT_TRUE(maker.Make(44, Precision::kFp16)->corrected.empty());
}

void ExpectSame(const ReducedBasis& a, const ReducedBasis& b) {
  EXPECT_EQ(a.basis, b.basis);
  EXPECT_EQ(a.head, b.head);
  EXPECT_EQ(a.coefficients.weight, b.coefficients.weight);
  EXPECT_EQ(a.coefficients.bias, b.coefficients.bias);
  EXPECT_EQ(a.corrected, b.corrected);
}

// Measured and expected moment, the one in proportion to the other; then corrections as int8 needs them.
TEST(RankMakerTest, BasesAreThoseOfTheirMoment) {
  Bundle bundle = OfRank44(120);
  bundle.skeleton->basis *= 0x1p-7f;  // millimetres: an expected moment of less than 1
  bundle.mesh->basis *= 0x1p-7f;
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  const BasisFrame frame = BasisRank(bundle).Frame();
  const std::vector<Sequence> motion = {ParseSequence(BundleSpec{}, 12)};
  const MatrixD expected = ExpectedMoment(frame), measured = DisplacementMoment(bundle, folded, frame, motion);
  ASSERT_LT(expected.trace(), 1);
  const MatrixD both = measured + kExpectedShare * measured.trace() / expected.trace() * expected;
  const double whole = QuantizeTwoSided("b", StackBasis(bundle).basis).squared_error;

  RankMaker still(bundle, folded, {}), moved(bundle, folded, motion);
  ASSERT_EQ(still.exact_rank(), 44u);
  EXPECT_FALSE(still.Make(RankMaker::kFullRank, Precision::kInt8));
  ReducedBasis exact = Reduce(bundle, frame, expected, 44);
  ExpectSame(*still.Make(44, Precision::kFp16), exact);
  AddCorrections(0.25 * whole, 44 / 20, &exact);
  ExpectSame(*still.Make(44, Precision::kInt8), exact);
  for (const uint32_t rank : {2u, 20u, 44u}) {
    ReducedBasis reduced = Reduce(bundle, frame, both, rank);
    ExpectSame(*moved.Make(rank, Precision::kFp32), reduced);
    TradeForCorrections(&reduced);
    ExpectSame(*moved.Make(rank, Precision::kInt8), reduced);
  }
}

TEST(RankMakerTest, ZeroBasesHaveARankToo) {
  Bundle bundle = ParseBundle({});
  bundle.skeleton->basis.setZero();
  bundle.mesh->basis.setZero();
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  const std::vector<Sequence> motion = {ParseSequence({}, 2)};
  RankMaker maker(bundle, folded, motion);
  ASSERT_EQ(maker.exact_rank(), 2u);
  const ReducedBasis reduced = *maker.Make(2, Precision::kFp32);
  EXPECT_TRUE(reduced.basis.isZero(0));
  EXPECT_TRUE(reduced.head.allFinite());
}

// A rank of all rows is none to store, even where a row of padding would be saved; remainders are rows too.
TEST(RankMakerTest, TheNumericalRankSavesWhereItIsLess) {
  const auto saves = [](const Bundle& bundle, Precision precision) {
    const FoldedBundle folded = FoldBundle(bundle, 4, 4);
    return RankMaker(bundle, folded, {}).ExactSaves(precision);
  };
  BundleSpec spec{.skeleton_basis = 5, .mesh_basis = 5};
  const Bundle odd = ParseBundle(spec);
  ASSERT_TRUE(ReductionSaves(odd, 10, Precision::kFp32));
  EXPECT_FALSE(saves(odd, Precision::kFp32));
  spec.mesh = spec.skeleton = false;
  const Bundle none = ParseBundle(spec);
  EXPECT_FALSE(saves(none, Precision::kFp32));
  const FoldedBundle folded = FoldBundle(none, 4, 4);
  EXPECT_EQ(RankMaker(none, folded, {}).full_rows(), 0u);
  EXPECT_EQ(RankMaker(none, folded, {}).exact_rank(), 0u);

  const Bundle low = OfRank44(110);
  EXPECT_TRUE(saves(low, Precision::kFp16));
  ASSERT_TRUE(ReductionSaves(low, 44, Precision::kInt8));
  ASSERT_FALSE(ReductionSaves(low, 46, Precision::kInt8));
  EXPECT_FALSE(saves(low, Precision::kInt8)) << "44 rows and two remainders";
}

}  // namespace
}  // namespace dcloth::converter
