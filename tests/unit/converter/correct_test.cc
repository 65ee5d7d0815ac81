#include "converter/correct.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/converter/low_rank.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::ParseBundle;

// Twelve directions, each half as strong as the one before: as a trained basis, steeper.
ReducedBasis Steep(double ratio = 0.5) {
  ReducedBasis reduced;
  reduced.basis = ParseBundle({.vertices = 200, .skeleton_basis = 12}).skeleton->basis;
  for (Eigen::Index j = 0; j < 12; ++j) reduced.basis.row(j) *= static_cast<float>(std::pow(ratio, j));
  reduced.head = Matrix::Random(9, 12);
  reduced.coefficients = {Matrix::Random(12, 5), Vector::Random(12)};
  return reduced;
}

double Value(const QuantizedMatrix& m, size_t row, size_t column) {
  return static_cast<double>(m.row_scales[row]) * static_cast<double>(m.column_scales[column]) *
         m.values[row * m.columns + column];
}

// What is lost of displacements whose coefficients are independent and of mean square 1, against `whole`.
double Lost(const Matrix& whole, const ReducedBasis& reduced) {
  const CorrectedMatrix corrected = QuantizeCorrected("b", reduced.basis, reduced.corrected);
  const QuantizedMatrix& stored = corrected.stored;
  double lost = 0;
  for (Eigen::Index j = 0; j < whole.rows(); ++j) {
    for (Eigen::Index c = 0; c < whole.cols(); ++c) {
      double value = j < reduced.basis.rows() ? Value(stored, static_cast<size_t>(j), static_cast<size_t>(c)) : 0;
      for (size_t i = 0; i < reduced.corrected.size(); ++i) {
        if (reduced.corrected[i] == j)
          value += Value(stored, static_cast<size_t>(reduced.basis.rows()) + i, static_cast<size_t>(c));
      }
      lost += (value - static_cast<double>(whole(j, c))) * (value - static_cast<double>(whole(j, c)));
    }
  }
  return lost;
}

TEST(CorrectTest, ARowAndItsRemainderHoldTwiceTheBits) {
  const ReducedBasis reduced = Steep();
  const std::vector<uint32_t> corrected = {3, 0};
  const CorrectedMatrix result = QuantizeCorrected("b", reduced.basis, corrected);
  const QuantizedMatrix& stored = result.stored;
  ASSERT_EQ(stored.rows, 14u);
  ASSERT_EQ(stored.values.size(), 14 * stored.columns);
  ASSERT_EQ(result.exact.rows(), 14);
  for (size_t i = 0; i < corrected.size(); ++i) {
    for (size_t c = 0; c < stored.columns; ++c) {
      const double sum = Value(stored, corrected[i], c) + Value(stored, 12 + i, c);
      const auto exact = static_cast<double>(reduced.basis(corrected[i], static_cast<Eigen::Index>(c)));
      const double step = static_cast<double>(stored.row_scales[corrected[i]]) *
                          static_cast<double>(stored.column_scales[c]);
      // Half of a 254th step, and the roundings of the scales' floats, which the 127 levels multiply.
      EXPECT_LE(std::abs(sum - exact), step / 508 * (1 + 1e-4)) << c;
    }
  }
  EXPECT_TRUE(result.exact.row(12).isApprox(
      reduced.basis.row(3) - result.exact.row(3), 1e-3f)) << "a row and its remainder add up to the row";
}

TEST(CorrectTest, TradesWeakDirectionsOnlyWhereThatLosesLess) {
  for (const double ratio : {0.3, 0.5, 0.7}) {
    const ReducedBasis whole = Steep(ratio);
    ReducedBasis traded = whole;
    TradeForCorrections(&traded);
    EXPECT_EQ(static_cast<size_t>(traded.basis.rows()) + traded.corrected.size(), 12u);
    EXPECT_EQ(traded.head.cols(), traded.basis.rows());
    EXPECT_EQ(traded.coefficients.weight.rows(), traded.basis.rows());
    EXPECT_EQ(traded.coefficients.bias.size(), traded.basis.rows());
    const double before = Lost(whole.basis, whole), after = Lost(whole.basis, traded);
    if (ratio < 0.6) {
      EXPECT_FALSE(traded.corrected.empty());
      EXPECT_LT(after, 0.5 * before) << ratio;
    } else {
      EXPECT_LE(after, before * (1 + 1e-6)) << ratio;
    }
  }
  ReducedBasis flat = Steep(1.0);  // all directions alike: none is worth less than rounding
  TradeForCorrections(&flat);
  EXPECT_TRUE(flat.corrected.empty());
  EXPECT_EQ(flat.basis.rows(), 12);
}

// Three strong directions beside five weak ones, of which the last loses most: next to the third strong one it would be
// corrected, though dropped before. A remainder without its row is of no use.
TEST(CorrectTest, CorrectsNoDirectionThatIsDropped) {
  ReducedBasis reduced = Steep(1.0);
  for (Eigen::Index j = 3; j < 8; ++j) reduced.basis.row(j) *= j < 7 ? 5e-4f : 8e-4f;
  reduced.basis.conservativeResize(8, Eigen::NoChange);
  const QuantizedMatrix stored = QuantizeTwoSided("b", reduced.basis);
  std::vector<double> lost(8);
  for (size_t i = 0; i < stored.values.size(); ++i) {
    const size_t j = i / stored.columns, c = i % stored.columns;
    const double exact = static_cast<double>(reduced.basis(static_cast<Eigen::Index>(j), static_cast<Eigen::Index>(c)));
    lost[j] += (Value(stored, j, c) - exact) * (Value(stored, j, c) - exact);
  }
  const double weak = reduced.basis.bottomRows(5).cast<double>().squaredNorm();
  ASSERT_GT(*std::min_element(lost.begin(), lost.begin() + 3), weak) << "each strong one is worth all the weak";
  ASSERT_GT(lost[7], *std::max_element(lost.begin() + 3, lost.begin() + 7));
  TradeForCorrections(&reduced);
  EXPECT_EQ(reduced.basis.rows(), 6);
  EXPECT_EQ(reduced.corrected.size(), 2u);
  for (const uint32_t row : reduced.corrected) EXPECT_LT(row, 3u);
}

TEST(CorrectTest, AddsNoMoreThanTheBoundNeeds) {
  const ReducedBasis whole = Steep();
  const double plain = Lost(whole.basis, whole);
  size_t last = 0;
  for (const double share : {1.01, 0.5, 0.1, 1e-2}) {
    ReducedBasis reduced = whole;
    AddCorrections(share * plain, 12, &reduced);
    EXPECT_LE(Lost(whole.basis, reduced), 1.01 * share * plain);
    EXPECT_GE(reduced.corrected.size(), last);
    last = reduced.corrected.size();
    if (share > 1) {
      EXPECT_EQ(last, 0u);
    } else {
      reduced.corrected.resize(last - 2);
      EXPECT_GT(Lost(whole.basis, reduced), 0.99 * share * plain) << "a pair fewer would do";
    }
    EXPECT_EQ(reduced.basis.rows(), 12);
  }
}

TEST(CorrectTest, AddsNoMoreRowsThanAllowed) {
  for (const size_t most : {0u, 1u, 2u, 5u}) {
    ReducedBasis reduced = Steep();
    AddCorrections(0, most, &reduced);
    EXPECT_EQ(reduced.corrected.size(), most / 2 * 2);
  }
}

TEST(CorrectTest, CopiesFollowTheirRows) {
  ReducedBasis reduced = Steep();
  reduced.corrected = {7, 2};
  const Matrix head = HeadWithCopies(reduced);
  const LinearWeights linear = CoefficientsWithCopies(reduced);
  ASSERT_EQ(head.cols(), 14);
  ASSERT_EQ(linear.weight.rows(), 14);
  EXPECT_EQ(head.col(12), reduced.head.col(7));
  EXPECT_EQ(linear.weight.row(13), reduced.coefficients.weight.row(2));
  EXPECT_EQ(linear.bias[12], reduced.coefficients.bias[7]);
  reduced.coefficients = {};
  EXPECT_EQ(CoefficientsWithCopies(reduced).weight.size(), 0);
}

}  // namespace
}  // namespace dcloth::converter
