#include "converter/rank.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "converter/calibrate.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"
#include "tests/unit/converter/low_rank.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BundleSpec;
using dcloth::testing::ParseBundle;
using dcloth::testing::ParseSequence;

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
  BundleSpec spec;
  spec.mesh = false;
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
  BundleSpec spec;
  spec.mesh = false;
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
    return dcloth::testing::ErrorText([&] { DisplacementMoment(bundle, folded, frame, motion); });
  };
  for (const double determinant : {0.0, 1e-9, -1e-9}) {
    EXPECT_EQ(refusal(determinant),
              "s: tensor joint_matrices: found joint joint_2 collapsed in frame 2, expected matrices with an inverse to "
              "calibrate on; leave this sequence out of --calibrate");
  }
  EXPECT_EQ(refusal(std::nextafter(1e-9, 1)), "");
  EXPECT_EQ(refusal(std::nextafter(-1e-9, -1)), "");
}

// Half of the moment is the skeleton stage's own: a mesh stage that cancels it must not drop its directions.
TEST(DisplacementMomentTest, KeepsBothLevels) {
  BundleSpec spec;
  Bundle bundle = ParseBundle(spec);
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  const BasisFrame frame = BasisRank(bundle).Frame();
  const std::vector<Sequence> motion = {ParseSequence(spec, 20)};
  const MatrixD both = DisplacementMoment(bundle, folded, frame, motion);
  bundle.mesh->basis.setZero();
  const MatrixD skeleton = DisplacementMoment(bundle, folded, frame, motion);
  EXPECT_GT((both - skeleton).norm(), 1e-3 * skeleton.norm()) << "the mesh stage shows";
  const double least = Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(both - 0.5 * skeleton))
                           .eigenvalues()
                           .minCoeff();
  EXPECT_GE(least, -1e-6 * skeleton.norm());
}

// Without motion an int8 basis keeps a share of the rounding of the whole one, by remainders: one row in twenty has one
// at most. Floats round little and need none.
TEST(RankMakerTest, WithoutMotionRowsGetRemainders) {
  BundleSpec spec;
  spec.vertices = 120;
  spec.skeleton_basis = 48;
  spec.mesh_basis = 16;
  Bundle bundle = ParseBundle(spec);
  dcloth::testing::LowerRank(&bundle, 44);
  const FoldedBundle folded = FoldBundle(bundle, 4, 4);
  RankMaker maker(bundle, folded, {});
  ASSERT_EQ(maker.exact_rank(), 44u);
  const ReducedBasis rounded = *maker.Make(44, Precision::kInt8);
  EXPECT_EQ(rounded.basis.rows(), 44);
  EXPECT_EQ(rounded.corrected.size(), 2u);
  EXPECT_TRUE(maker.Make(44, Precision::kFp16)->corrected.empty());
}

}  // namespace
}  // namespace dcloth::converter
