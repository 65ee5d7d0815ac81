#include "converter/loss.h"

#include <gtest/gtest.h>

#include <cmath>

#include "kernels/half.h"

namespace dcloth::converter {
namespace {

TEST(LossTest, CountsByHand) {
  Matrix exact(2, 3);
  exact << 200, -130, 0.4f, 127.4f, 0, -63.75f;
  QuantizedMatrix stored;
  stored.rows = 2, stored.columns = 3;
  stored.row_scales = {1, 0.5f};
  stored.column_scales = {1, 1, 1};
  // Row 1 has half the step: 127.4 would be level 255, -63.75 is just not past 127.5 levels.
  stored.values = {127, -127, 0, 127, 0, -127};
  const TensorLoss loss = LossOf(exact, stored);
  EXPECT_EQ(loss.lowest, -130);
  EXPECT_EQ(loss.highest, 200);
  EXPECT_EQ(loss.clipped, 3u);
  EXPECT_EQ(loss.zeroed, 1u);  // 0.4; the true zero does not count
  const double small = static_cast<double>(0.4f), large = static_cast<double>(127.4f);
  const double error = 73 * 73 + 3 * 3 + small * small + std::pow(large - 63.5, 2) + 0.25 * 0.25;
  const double total = 200 * 200 + 130 * 130 + small * small + large * large + 63.75 * 63.75;
  EXPECT_NEAR(loss.snr_db, 10 * std::log10(total / error), 1e-12);
  EXPECT_NEAR(loss.relative_rms, std::sqrt(error / total), 1e-15);
  EXPECT_NEAR(loss.relative_max, 73.0 / 200, 1e-15);
}

TEST(LossTest, TightScalesClipNothingAndAnOutlierZeroesItsColumn) {
  Matrix exact = Matrix::Constant(40, 1, 1);
  exact(7, 0) = 1000;  // a step of 1000 / 127: ones are below half of it
  const QuantizedMatrix per_column = QuantizePerColumn("w", exact);
  const TensorLoss loss = LossOf(exact, per_column);
  EXPECT_EQ(loss.clipped, 0u);
  EXPECT_EQ(loss.zeroed, 39u);
  EXPECT_EQ(LossOf(exact, QuantizeTwoSided("w", exact)).zeroed, 0u);  // a row scale takes the outlier
}

// Each row has one element a thousand times the others, which are lost in row 2 alone.
TEST(LossTest, ARowIsJudgedWithoutItsOutlier) {
  Matrix exact = Matrix::Ones(4, 8);
  exact.col(3).setConstant(1000);
  QuantizedMatrix stored;
  stored.rows = 4, stored.columns = 8;
  stored.row_scales.assign(4, 1);
  stored.column_scales = {0.75f, 0.75f, 0.75f, 10, 0.75f, 0.75f, 0.75f, 0.75f};
  stored.values.assign(32, 1);
  for (size_t j = 0; j < 4; ++j) stored.values[8 * j + 3] = 100;
  for (size_t c = 0; c < 8; ++c) {
    if (c != 3) stored.values[16 + c] = 0;
  }
  const TensorLoss loss = LossOf(exact, stored);
  EXPECT_GT(loss.snr_db, 50);
  ASSERT_TRUE(loss.worst_row);
  EXPECT_EQ(loss.worst_row->row, 2u);
  EXPECT_EQ(loss.worst_row->snr_db, 0);      // of seven ones nothing is left
  EXPECT_EQ(loss.worst_row->low_count, 4u);  // a quarter of each is 12 dB
  for (size_t i = 0; i < 32; ++i) {
    if (i / 8 == 2 && i % 8 != 3) stored.values[i] = 1;
  }
  EXPECT_NEAR(LossOf(exact, stored).worst_row->snr_db, 20 * std::log10(4), 1e-12);
  stored.column_scales.assign(8, 1);
  stored.column_scales[3] = 10;
  EXPECT_FALSE(LossOf(exact, stored).worst_row);
}

TEST(LossTest, RowsFarBelowTheOthersAreNotJudged) {
  Matrix exact = Matrix::Ones(5, 6);
  exact.row(1) *= 0.09f;
  exact.row(4).setZero();
  QuantizedMatrix stored;
  stored.rows = 5, stored.columns = 6;
  stored.row_scales.assign(5, 1);
  stored.column_scales.assign(6, 1);
  stored.values.assign(30, 1);
  for (size_t i = 6; i < 12; ++i) stored.values[i] = 0;
  for (size_t i = 24; i < 30; ++i) stored.values[i] = 0;
  EXPECT_FALSE(LossOf(exact, stored).worst_row);
  exact.row(1) *= 2;
  EXPECT_EQ(LossOf(exact, stored).worst_row->row, 1u);
  EXPECT_FALSE(LossOf(Matrix::Ones(3, 1) * 0.3f, QuantizeHalf("w", Matrix::Ones(3, 1) * 0.3f)).worst_row);
}

TEST(LossTest, HalvesUnderflowAndMayBeExact) {
  Matrix exact(1, 4);
  exact << 1e-8f, 4e-8f, 0, 2;  // half of the smallest half is 2^-25 = 2.98e-8
  const TensorLoss loss = LossOf(exact, QuantizeHalf("w", exact));
  EXPECT_EQ(loss.zeroed, 1u);
  EXPECT_EQ(loss.clipped, 0u);
  EXPECT_TRUE(std::isfinite(loss.snr_db));
  EXPECT_EQ(loss.relative_max, (0x1p-24 - static_cast<double>(4e-8f)) / 2);
  exact << 0.5f, -0.25f, 0, 2;
  const TensorLoss none = LossOf(exact, QuantizeHalf("w", exact));
  EXPECT_EQ(none.snr_db, INFINITY);
  EXPECT_EQ(none.relative_rms, 0);
  EXPECT_EQ(none.lowest, -0.25);
}

TEST(LossTest, NothingIsLostOfNothing) {
  EXPECT_EQ(ExactLoss({}).highest, 0);
  const Matrix zero = Matrix::Zero(3, 3);
  const TensorLoss loss = LossOf(zero, QuantizeTwoSided("w", zero));
  EXPECT_EQ(loss.snr_db, INFINITY);
  EXPECT_EQ(loss.zeroed, 0u);
}

}  // namespace
}  // namespace dcloth::converter
