#include "converter/quantize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "kernels/half.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

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

// Column by column, for given row scales.
QuantizedMatrix TightByHand(const Matrix& weights, const std::vector<double>& row_scales,
                            const std::vector<double>& importance) {
  QuantizedMatrix q;
  q.rows = static_cast<size_t>(weights.rows()), q.columns = static_cast<size_t>(weights.cols());
  q.row_scales.assign(row_scales.begin(), row_scales.end());
  q.column_scales.resize(q.columns);
  q.values.resize(q.rows * q.columns);
  const auto weight = [&](size_t j, size_t c) {
    return static_cast<double>(weights(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(c)));
  };
  for (size_t c = 0; c < q.columns; ++c) {
    double largest = 0;
    for (size_t j = 0; j < q.rows; ++j) {
      largest = std::max(largest, std::abs(weight(j, c)) / static_cast<double>(q.row_scales[j]));
    }
    const double exact = std::max(largest / 127, 1e-30);
    auto scale = static_cast<float>(exact);
    if (static_cast<double>(scale) < exact) scale = std::nextafter(scale, INFINITY);
    q.column_scales[c] = largest == 0 ? 1 : scale;
  }
  for (size_t j = 0; j < q.rows; ++j) {
    double error = 0;
    for (size_t c = 0; c < q.columns; ++c) {
      const double step = static_cast<double>(q.row_scales[j]) * static_cast<double>(q.column_scales[c]);
      q.values[j * q.columns + c] = static_cast<int8_t>(std::clamp(std::nearbyint(weight(j, c) / step), -127.0, 127.0));
      error += std::pow(weight(j, c) - StoredAt(q, j, c), 2);
    }
    q.squared_error += error * (importance.empty() ? 1 : importance[j]);
  }
  return q;
}

void NormaliseByHand(std::vector<double>* scales) {
  const double largest = *std::max_element(scales->begin(), scales->end());
  for (double& scale : *scales) scale = scale == 0 ? 1 : std::max(scale / largest, 1e-6);
}

// The best of row scales 1 and six others, each lowered twice to what the columns leave of its row.
QuantizedMatrix TwoSidedByHand(const Matrix& weights, const std::vector<double>& importance) {
  const Eigen::Index rows = weights.rows(), columns = weights.cols();
  std::vector<double> ones(static_cast<size_t>(rows), 1.0);
  QuantizedMatrix best = TightByHand(weights, ones, importance);
  for (const bool rms : {true, false}) {
    for (const double power : {0.5, 0.75, 1.0}) {
      VectorD sizes(rows);
      for (Eigen::Index j = 0; j < rows; ++j) {
        const Eigen::RowVectorXd row = weights.row(j).cast<double>();
        sizes[j] = rms ? std::sqrt(row.squaredNorm() / static_cast<double>(columns)) : row.cwiseAbs().maxCoeff();
      }
      sizes = sizes.array().pow(power).eval();
      std::vector<double> scales(sizes.begin(), sizes.end());
      NormaliseByHand(&scales);
      for (int sweep = 0; sweep < 2; ++sweep) {
        std::vector<double> lowered(scales.size(), 0.0);
        for (Eigen::Index c = 0; c < columns; ++c) {
          double tight = 0;
          for (Eigen::Index j = 0; j < rows; ++j) {
            tight =
                std::max(tight, std::abs(static_cast<double>(weights(j, c))) * (1 / scales[static_cast<size_t>(j)]));
          }
          for (Eigen::Index j = 0; j < rows && tight > 0; ++j) {
            double& row = lowered[static_cast<size_t>(j)];
            row = std::max(row, std::abs(static_cast<double>(weights(j, c))) * (1 / tight));
          }
        }
        scales = lowered;
        NormaliseByHand(&scales);
      }
      QuantizedMatrix other = TightByHand(weights, scales, importance);
      if (other.squared_error < best.squared_error) best = std::move(other);
    }
  }
  return best;
}

TEST(QuantizeTest, ScalesAndValuesByHand) {
  unsigned seed = 20;
  for (const auto& [rows, columns] : {std::pair(1, 1), {1, 9}, {9, 1}, {3, 4}, {8, 8}, {12, 30}, {40, 7}}) {
    for (const float decay : {0.0f, 2.0f, 12.0f, 40.0f}) {
      for (const int zeros : {0, 1, 2, 3}) {
        Matrix weights = Random(rows, columns, ++seed);
        for (Eigen::Index j = 0; j < rows; ++j) {
          weights.row(j) *= std::exp2(-decay * static_cast<float>(j) / static_cast<float>(rows));
        }
        weights(rows / 2, columns / 2) *= 20;
        if (zeros == 1) weights.row(rows - 1).setZero();
        if (zeros == 2) weights.col(columns - 1).setZero();
        if (zeros == 3) weights.col(0).setZero();
        std::vector<double> importance;
        for (Eigen::Index j = 0; j < rows && seed % 2 == 0; ++j) importance.push_back(1 + static_cast<double>(j % 5));
        const QuantizedMatrix expected = TwoSidedByHand(weights, importance);
        const QuantizedMatrix found = QuantizeTwoSided("w", weights, importance);
        ASSERT_EQ(found.row_scales, expected.row_scales) << seed;
        ASSERT_EQ(found.column_scales, expected.column_scales) << seed;
        ASSERT_EQ(found.values, expected.values) << seed;
        EXPECT_DOUBLE_EQ(found.squared_error, expected.squared_error);
      }
    }
  }
}

// Where no row counts, none of the scales is better than one for all rows.
TEST(QuantizeTest, EqualErrorsKeepPlainColumns) {
  const Matrix weights = Decaying(6, 10);
  const std::vector<double> none(6, 0.0);
  EXPECT_EQ(QuantizeTwoSided("w", weights, none).row_scales, std::vector<float>(6, 1.0f));
}

TEST(QuantizeTest, IsDeterministic) {
  const Matrix weights = Decaying(33, 77);
  const QuantizedMatrix a = QuantizeTwoSided("w", weights), b = QuantizeTwoSided("w", weights);
  EXPECT_EQ(a.values, b.values);
  EXPECT_EQ(a.row_scales, b.row_scales);
  EXPECT_EQ(a.column_scales, b.column_scales);
}

TEST(QuantizeTest, HalvesAreNearestAndOverflowIsRefused) {
  Matrix weights = Random(5, 9, 4) * 100;
  const std::vector<uint16_t> halves = QuantizeHalf("w", weights);
  for (size_t i = 0; i < halves.size(); ++i) {
    const float weight = weights.data()[i];
    // Normal halves: 11 significant bits.
    EXPECT_LE(std::abs(kernels::FloatFromHalf(halves[i]) - weight), std::abs(weight) * 0x1p-11f + 0x1p-25f);
  }
  weights(3, 2) = -65520;
  EXPECT_TRUE(Mentions(ErrorText([&] { QuantizeHalf("mesh.basis", weights); }), "mesh.basis", "the weight -65520",
                       "--precision fp32"));
  weights(3, 2) = -65519;
  EXPECT_EQ(ErrorText([&] { QuantizeHalf("w", weights); }), "");
}

}  // namespace
}  // namespace dcloth::converter
