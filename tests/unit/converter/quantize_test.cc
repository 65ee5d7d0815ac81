#include "converter/quantize.h"

#include <gtest/gtest.h>

#include <cmath>

#include "converter/half.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;

Matrix Random(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::srand(seed);
  return Matrix::Random(rows, columns);
}

// Rows of sizes 1 to 1/4096, as a basis sorted by its singular values has.
Matrix Decaying(Eigen::Index rows, Eigen::Index columns) {
  Matrix weights = Random(rows, columns, 3);
  for (Eigen::Index j = 0; j < rows; ++j) {
    weights.row(j) *= std::exp2(-12.0f * static_cast<float>(j) / static_cast<float>(rows));
  }
  return weights;
}

double StoredAt(const QuantizedMatrix& q, size_t j, size_t c) {
  return static_cast<double>(q.row_scales[j]) * static_cast<double>(q.column_scales[c]) * q.values[j * q.columns + c];
}

void CheckBounds(const Matrix& weights, const QuantizedMatrix& q) {
  ASSERT_EQ(q.rows, static_cast<size_t>(weights.rows()));
  ASSERT_EQ(q.columns, static_cast<size_t>(weights.cols()));
  ASSERT_EQ(q.values.size(), q.rows * q.columns);
  double squared = 0;
  for (size_t j = 0; j < q.rows; ++j) {
    ASSERT_TRUE(std::isfinite(q.row_scales[j]) && q.row_scales[j] > 0 && q.row_scales[j] <= 1);
    for (size_t c = 0; c < q.columns; ++c) {
      ASSERT_TRUE(std::isfinite(q.column_scales[c]) && q.column_scales[c] > 0);
      ASSERT_GE(q.values[j * q.columns + c], -127);
      const double weight = static_cast<double>(weights(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(c)));
      const double step = static_cast<double>(q.row_scales[j]) * static_cast<double>(q.column_scales[c]);
      const double error = std::abs(weight - StoredAt(q, j, c));
      // Half a step; weight / step is rounded once in double, 127 steps at most.
      ASSERT_LE(error, step * (0.5 + 128 * 0x1p-52)) << j << ", " << c;
      squared += error * error;
    }
  }
  EXPECT_NEAR(q.squared_error, squared, 1e-9 * squared);
}

TEST(QuantizeTest, EveryErrorIsAtMostHalfAStep) {
  unsigned seed = 0;
  for (const auto& [rows, columns] : {std::pair(1, 1), {1, 33}, {7, 1}, {2, 2}, {31, 65}, {64, 96}, {97, 301}}) {
    const Matrix weights = Random(rows, columns, ++seed);
    CheckBounds(weights, QuantizeTwoSided("w", weights));
    CheckBounds(weights, QuantizePerColumn("w", weights));
  }
  CheckBounds(Decaying(64, 200), QuantizeTwoSided("w", Decaying(64, 200)));
  Matrix spiky = Random(40, 60, 5);
  spiky(3, 7) = 1000;
  CheckBounds(spiky, QuantizeTwoSided("w", spiky));
}

TEST(QuantizeTest, NeverWorseThanPerColumnAndFarBetterOnADecayingBasis) {
  for (unsigned seed = 1; seed < 8; ++seed) {
    const Matrix weights = Random(30, 50, seed);
    EXPECT_LE(QuantizeTwoSided("w", weights).squared_error, QuantizePerColumn("w", weights).squared_error);
  }
  // Row scales equal to the rows' maxima make every column scale at most 1 / 127, so each error is at most half of
  // s_j / 127 with s_j <= 2^(-12 j / rows): a certain bound, which plain scales miss on the same matrix.
  const Matrix weights = Decaying(64, 200);
  double bound = 0;
  for (int j = 0; j < 64; ++j) bound += 200 * std::pow(std::exp2(-12.0 * j / 64) / 254, 2);
  EXPECT_LT(QuantizeTwoSided("w", weights).squared_error, bound);
  EXPECT_GT(QuantizePerColumn("w", weights).squared_error, bound);
}

TEST(QuantizeTest, RowWeightsDecide) {
  const Matrix weights = Decaying(16, 64);
  std::vector<double> importance(16, 0.0);
  importance[15] = 1;
  const QuantizedMatrix q = QuantizeTwoSided("w", weights, importance);
  double squared = 0;
  for (size_t c = 0; c < 64; ++c) {
    const double error = static_cast<double>(weights(15, static_cast<Eigen::Index>(c))) - StoredAt(q, 15, c);
    squared += error * error;
  }
  EXPECT_NEAR(q.squared_error, squared, 1e-9 * squared);
}

TEST(QuantizeTest, ZeroRowsColumnsAndMatrices) {
  Matrix weights = Random(9, 40, 2);
  weights.row(4).setZero();
  weights.col(11).setZero();
  const QuantizedMatrix q = QuantizeTwoSided("w", weights);
  CheckBounds(weights, q);
  for (size_t c = 0; c < 40; ++c) EXPECT_EQ(q.values[4 * 40 + c], 0);
  for (size_t j = 0; j < 9; ++j) EXPECT_EQ(q.values[j * 40 + 11], 0);
  CheckBounds(Matrix::Zero(3, 5), QuantizeTwoSided("w", Matrix::Zero(3, 5)));
}

TEST(QuantizeTest, ExtremesStayInRange) {
  Matrix weights = Random(6, 6, 9);
  weights.row(0) *= 1e-38f;
  weights.row(1) *= 1e29f;
  CheckBounds(weights, QuantizeTwoSided("w", weights));
  CheckBounds(Matrix::Constant(2, 2, 1e-42f), QuantizeTwoSided("w", Matrix::Constant(2, 2, 1e-42f)));
  weights(2, 2) = 2e30f;
  EXPECT_TRUE(Mentions(ErrorText([&] { QuantizeTwoSided("basis", weights); }), "tensor basis: found the weight"));
  EXPECT_TRUE(Mentions(ErrorText([&] { QuantizeTwoSided("basis", Matrix()); }), "an empty matrix"));
}

TEST(QuantizeTest, IsDeterministic) {
  const Matrix weights = Decaying(33, 77);
  const QuantizedMatrix a = QuantizeTwoSided("w", weights), b = QuantizeTwoSided("w", weights);
  EXPECT_EQ(a.values, b.values);
  EXPECT_EQ(a.row_scales, b.row_scales);
  EXPECT_EQ(a.column_scales, b.column_scales);
}

TEST(QuantizeTest, HalvesAreNearestAndOverflowIsRefusedWithItsPlace) {
  Matrix weights = Random(5, 9, 4) * 100;
  const std::vector<uint16_t> halves = QuantizeHalf("w", weights);
  for (size_t i = 0; i < halves.size(); ++i) {
    const float weight = weights.data()[i];
    // Normal halves: 11 significant bits.
    EXPECT_LE(std::abs(HalfToFloat(halves[i]) - weight), std::abs(weight) * 0x1p-11f + 0x1p-25f);
  }
  weights(3, 2) = -65520;
  EXPECT_TRUE(Mentions(ErrorText([&] { QuantizeHalf("mesh.basis", weights); }), "mesh.basis", "at row 3, column 2",
                       "--precision fp32"));
  weights(3, 2) = -65519;
  EXPECT_EQ(ErrorText([&] { QuantizeHalf("w", weights); }), "");
}

}  // namespace
}  // namespace dcloth::converter
