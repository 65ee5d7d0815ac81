#include "converter/prune.h"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <numbers>

namespace dcloth::converter {
namespace {

TEST(PruneTest, KeepsTheStrongestAndRenormalises) {
  MatrixD dense(3, 4);
  dense << 0.1, 0.5, 0.15, 0.25,  //
      1, 0, 0, 0,                 //
      0.25, 0.25, 0.25, 0.25;
  const PrunedWeights pruned = Prune(dense, 2);
  EXPECT_EQ(pruned.columns,
            (std::vector<uint32_t>{1, 3, 0, 0, 0, 1}));  // an unused one repeats the first; ties to the lower column
  EXPECT_EQ(pruned.weights,
            (std::vector<float>{static_cast<float>(0.5 / 0.75), static_cast<float>(0.25 / 0.75), 1, 0, 0.5f, 0.5f}));
}

TEST(PruneTest, KIsLoweredToTheColumns) {
  MatrixD dense(1, 2);
  dense << 0.25, 0.75;
  EXPECT_EQ(Prune(dense, 8).influences, 2u);
  EXPECT_EQ(Prune(dense, 8).weights, (std::vector<float>{0.75f, 0.25f}));
}

TEST(PruneTest, KIsLoweredToTheMostWeightsWorthKeeping) {
  const auto influences = [](double first, double second, uint32_t asked) {
    MatrixD dense(3, 3);
    dense << 0.75, first, second,  //
        0, 1, 0,                   //
        0, 0, 1;
    return Prune(dense, asked).influences;
  };
  EXPECT_EQ(influences(0, 0, 8), 1u);
  EXPECT_EQ(influences(kNegligibleWeight, 0, 8), 1u) << "no more than negligible";
  EXPECT_EQ(influences(std::nextafter(kNegligibleWeight, 1), 0, 8), 2u);
  EXPECT_EQ(influences(0.125, 0.125, 8), 3u);
  EXPECT_EQ(influences(0.125, 0.125, 2), 2u);
  MatrixD last(2, 2);
  last << 1, 0, 0.5, 0.5;
  EXPECT_EQ(Prune(last, 8).influences, 2u);
}

TEST(PruneTest, RowsSumToOne) {
  const MatrixD random = MatrixD::Random(200, 24).cwiseAbs2();
  const MatrixD dense = random.array().colwise() / random.rowwise().sum().array();
  for (uint32_t k = 1; k <= 8; ++k) {
    const PrunedWeights pruned = Prune(dense, k);
    for (size_t i = 0; i < 200; ++i) {
      double sum = 0;
      for (size_t at = i * k; at < (i + 1) * k; ++at) sum += static_cast<double>(pruned.weights[at]);
      ASSERT_LE(std::abs(sum - 1), k * 0x1p-24);
    }
  }
}

// Two bones a metre apart, the second one bent by a right angle: the error can be written down.
TEST(PruneTest, MeasuresAKnownError) {
  MatrixD dense(1, 2);
  dense << 0.75, 0.25;
  Matrix points(1, 3);
  points << 0, -1.5f, 0;
  MatrixD pivots(2, 3);
  pivots << 0, 0, 0, 0, -1, 0;
  Eigen::Affine3d bent = Eigen::Translation3d(0, -1, 0) *
                         Eigen::AngleAxisd(std::numbers::pi / 2, Eigen::Vector3d::UnitZ()) *
                         Eigen::Translation3d(0, 1, 0);
  const std::vector<Eigen::Matrix4d> rest(2, Eigen::Matrix4d::Identity());
  const std::vector<std::vector<Eigen::Matrix4d>> poses = {rest, {Eigen::Matrix4d::Identity(), bent.matrix()}};
  const PruneReport report = MeasurePruning(dense, Prune(dense, 1), points, pivots, poses);
  // Bone 1 takes the point to (0.5, -1, 0), 0.25 of the way is lost: 0.25 |(0.5, 0.5, 0)| in the second pose, none in
  // the first.
  const double expected_mm = 250 * std::sqrt(0.5);
  EXPECT_TRUE(report.measured);
  EXPECT_NEAR(report.worst_mm, expected_mm, 1e-9);
  EXPECT_NEAR(report.mean_mm, expected_mm / 2, 1e-9);
  EXPECT_EQ(report.removed_worst, 0.25);
  EXPECT_NEAR(report.bound_worst_mm, 250 * (0.5 + 1 + 1.5), 1e-9);
  EXPECT_GE(report.bound_worst_mm, report.worst_mm);
}

// Nearer to each other than a metre, whose rotations move less.
TEST(PruneTest, TheBoundShrinksWithDistances) {
  MatrixD dense(1, 2);
  dense << 0.75, 0.25;
  Matrix points(1, 3);
  points << 0, -0.125f, 0;
  MatrixD pivots(2, 3);
  pivots << 0, 0, 0, 0, -0.0625, 0;
  EXPECT_EQ(MeasurePruning(dense, Prune(dense, 1), points, pivots, {}).bound_worst_mm, 250 * 0.25);
}

// The bound holds for any rotations while the pivots keep their distances.
TEST(PruneTest, BoundHoldsForRandomPoses) {
  std::srand(7);
  const MatrixD random = MatrixD::Random(60, 6).cwiseAbs2();
  const MatrixD dense = random.array().colwise() / random.rowwise().sum().array();
  const Matrix points = Matrix::Random(60, 3);
  const MatrixD pivots = MatrixD::Random(6, 3);
  std::vector<std::vector<Eigen::Matrix4d>> poses(50);
  for (auto& pose : poses) {
    for (Eigen::Index j = 0; j < 6; ++j) {
      const Eigen::Vector3d pivot = pivots.row(j);
      const Eigen::Quaterniond rotation(Eigen::Vector4d::Random().normalized());
      pose.push_back((Eigen::Translation3d(pivot) * rotation * Eigen::Translation3d(-pivot)).matrix());
    }
  }
  double last = INFINITY;
  for (const uint32_t k : {1u, 2u, 4u, 6u}) {
    const PruneReport report = MeasurePruning(dense, Prune(dense, k), points, pivots, poses);
    EXPECT_LE(report.worst_mm, report.bound_worst_mm + 1e-3);  // float weights
    EXPECT_LT(report.mean_mm, last);
    last = report.mean_mm;
  }
  EXPECT_LT(last, 1e-3);  // nothing removed: float weights of points within 2 m leave 6 * 2 m * 2^-25
}

// Points, weights, pivots and poses of any kind, number by number. Two weights of five are kept, and two rows have
// fewer.
TEST(PruneTest, MeasuresEveryPointByHand) {
  constexpr int kPoints = 6, kBones = 5, kPoses = 3;
  std::srand(11);
  MatrixD dense = MatrixD::Random(kPoints, kBones).cwiseAbs();
  dense(0, 3) = dense(2, 0) = dense(2, 1) = 0;
  dense.row(3) << 0, 0.25, 0, 0.75, 0;
  dense.row(4) << 0, 0, 0, 0, 1;
  for (Eigen::Index i = 0; i < kPoints; ++i) dense.row(i) /= dense.row(i).sum();
  const Matrix points = Matrix::Random(kPoints, 3);
  const MatrixD pivots = MatrixD::Random(kBones, 3);
  std::vector<std::vector<Eigen::Matrix4d>> poses(kPoses);
  for (auto& pose : poses) {
    for (int j = 0; j < kBones; ++j) {
      pose.push_back(Eigen::Matrix4d::Random());
      pose.back().row(3) << 0, 0, 0, 1;
    }
  }
  const PrunedWeights pruned = Prune(dense, 2);
  ASSERT_EQ(pruned.influences, 2u);

  const auto distance = [](const auto& a, const auto& b) {
    return std::hypot(static_cast<double>(a[0]) - static_cast<double>(b[0]),
                      static_cast<double>(a[1]) - static_cast<double>(b[1]),
                      static_cast<double>(a[2]) - static_cast<double>(b[2]));
  };
  double removed_sum = 0, removed_worst = 0, bound = 0, error_sum = 0, error_worst = 0;
  for (int i = 0; i < kPoints; ++i) {
    double kept[kBones] = {};
    for (size_t k = 0; k < 2; ++k) {
      const size_t at = static_cast<size_t>(2 * i) + k;
      kept[pruned.columns[at]] += static_cast<double>(pruned.weights[at]);
    }
    double removed = 0, spread = 0;
    for (int j = 0; j < kBones; ++j) {
      if (kept[j] > 0 || dense(i, j) == 0) continue;
      removed += dense(i, j);
      for (int other = 0; other < kBones; ++other) {
        if (kept[other] == 0) continue;
        spread = std::max(spread, distance(points.row(i), pivots.row(j)) + distance(pivots.row(j), pivots.row(other)) +
                                      distance(pivots.row(other), points.row(i)));
      }
    }
    removed_sum += removed;
    removed_worst = std::max(removed_worst, removed);
    bound = std::max(bound, removed * spread);
    for (const auto& pose : poses) {
      double moved[3] = {}, still[3] = {};
      for (int j = 0; j < kBones; ++j) {
        for (int axis = 0; axis < 3; ++axis) {
          double image = pose[static_cast<size_t>(j)](axis, 3);
          for (int from = 0; from < 3; ++from) {
            image += pose[static_cast<size_t>(j)](axis, from) * static_cast<double>(points(i, from));
          }
          moved[axis] += dense(i, j) * image;
          still[axis] += kept[j] * image;
        }
      }
      error_sum += distance(moved, still);
      error_worst = std::max(error_worst, distance(moved, still));
    }
  }
  const PruneReport report = MeasurePruning(dense, pruned, points, pivots, poses);
  EXPECT_EQ(report.influences, 2u);
  EXPECT_NEAR(report.removed_mean, removed_sum / kPoints, 1e-12);
  EXPECT_NEAR(report.removed_worst, removed_worst, 1e-12);
  EXPECT_NEAR(report.bound_worst_mm, 1000 * bound, 1e-9);
  EXPECT_NEAR(report.mean_mm, 1000 * error_sum / (kPoints * kPoses), 1e-9);
  EXPECT_NEAR(report.worst_mm, 1000 * error_worst, 1e-9);
}

// A bone that has no weight is not removed, wherever it is.
TEST(PruneTest, BonesWithoutWeightAreOutOfTheBound) {
  MatrixD dense(1, 3);
  dense << 0.75, 0.25, 0;
  MatrixD pivots(3, 3);
  pivots << 0, 0, 0, 0, 1, 0, 0, 100, 0;
  EXPECT_EQ(MeasurePruning(dense, Prune(dense, 1), Matrix::Zero(1, 3), pivots, {}).bound_worst_mm, 250 * 2);
}

TEST(PruneTest, WithoutPosesNothingIsMeasured) {
  MatrixD dense(1, 2);
  dense << 0.75, 0.25;
  const PruneReport report = MeasurePruning(dense, Prune(dense, 1), Matrix::Zero(1, 3), MatrixD::Zero(2, 3), {});
  EXPECT_FALSE(report.measured);
  EXPECT_EQ(report.removed_mean, 0.25);
}

}  // namespace
}  // namespace dcloth::converter
