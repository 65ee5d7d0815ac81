#include "converter/correct.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

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
      const double step =
          static_cast<double>(stored.row_scales[corrected[i]]) * static_cast<double>(stored.column_scales[c]);
      // Half of a 254th step, and the roundings of the scales' floats, which the 127 levels multiply.
      EXPECT_LE(std::abs(sum - exact), step / 508 * (1 + 1e-4)) << c;
    }
  }
  EXPECT_TRUE(result.exact.row(12).isApprox(reduced.basis.row(3) - result.exact.row(3), 1e-3f))
      << "a row and its remainder add up to the row";
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

// A row of the pair that would go rounds to nothing and is worst or second worst; the other one of the pair is zero.
TEST(CorrectTest, CorrectsNoDirectionOfThePairThatGoes) {
  constexpr float kExact = 127.0f / 128;  // rounding takes nothing from it
  for (const float rounds_to_zero : {1e-9f, 3.7e-9f}) {
    ReducedBasis reduced;
    reduced.basis.resize(4, 3);
    reduced.basis << kExact, kExact, rounds_to_zero,  //
        kExact, 0, kExact,                            //
        2e-9f, 2e-9f, 2e-9f,                          //
        0, 0, 0;
    reduced.head = Matrix::Ones(1, 4);
    const QuantizedMatrix stored = QuantizeTwoSided("b", reduced.basis);
    ASSERT_EQ(stored.values, (std::vector<int8_t>{127, 127, 0, 127, 0, 127, 0, 0, 0, 0, 0, 0}));
    TradeForCorrections(&reduced);
    EXPECT_TRUE(reduced.corrected.empty()) << rounds_to_zero;
    EXPECT_EQ(reduced.basis.rows(), 4) << rounds_to_zero;
    EXPECT_EQ(reduced.coefficients.bias.size(), 0) << "without a mesh stage there are none";
  }
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

// Rows of any strength, in any order.
ReducedBasis Any(std::mt19937* random) {
  const auto uniform = [&] { return static_cast<float>((*random)() % 20001) / 10000 - 1; };
  ReducedBasis reduced;
  const auto rows = static_cast<Eigen::Index>(1 + (*random)() % 16);
  const auto columns = static_cast<Eigen::Index>(9 + (*random)() % 12);
  reduced.basis.resize(rows, columns);
  reduced.head.resize(3, rows);
  reduced.coefficients = {Matrix(rows, 2), Vector(rows)};
  const bool sorted = (*random)() % 2 == 0;
  float strength = 1;
  for (Eigen::Index j = 0; j < rows; ++j) {
    strength = sorted ? strength * (0.2f + uniform() / 6) : std::pow(10.0f, 2 * uniform() - 2);
    for (Eigen::Index c = 0; c < columns; ++c) reduced.basis(j, c) = strength * uniform();
    for (Eigen::Index i = 0; i < 3; ++i) reduced.head(i, j) = uniform();
    for (Eigen::Index i = 0; i < 2; ++i) reduced.coefficients.weight(j, i) = uniform();
    reduced.coefficients.bias[j] = uniform();
  }
  return reduced;
}

struct Loss {
  double squared;
  uint32_t row;
};

// What rounding takes from each row, worst first.
std::vector<Loss> LossesByHand(const Matrix& basis) {
  const QuantizedMatrix stored = QuantizeTwoSided("b", basis);
  std::vector<Loss> losses;
  for (uint32_t j = 0; j < stored.rows; ++j) {
    losses.push_back({0, j});
    for (size_t c = 0; c < stored.columns; ++c) {
      const double apart = static_cast<double>(basis(j, static_cast<Eigen::Index>(c))) - Value(stored, j, c);
      losses.back().squared += apart * apart;
    }
  }
  std::stable_sort(losses.begin(), losses.end(), [](const Loss& a, const Loss& b) { return a.squared > b.squared; });
  return losses;
}

// Pair after pair as long as both rows are kept and lose more than the pair that goes carries.
TEST(CorrectTest, TradesArePairsByHand) {
  std::mt19937 random(3);
  std::vector<size_t> pairs(5);
  for (int trial = 0; trial < 1500; ++trial) {
    const ReducedBasis whole = Any(&random);
    const std::vector<Loss> losses = LossesByHand(whole.basis);
    std::vector<double> carried;
    for (Eigen::Index j = 0; j < whole.basis.rows(); ++j) {
      carried.push_back(whole.basis.row(j).cast<double>().squaredNorm());
    }
    std::vector<uint32_t> expected;
    for (size_t next = 0; 2 * next + 4 <= carried.size(); next += 2) {
      const size_t left = carried.size() - next - 2;  // after this trade
      const Loss first = losses[next], second = losses[next + 1];
      if (first.row >= left || second.row >= left) break;
      if (!(first.squared + second.squared > carried[left] + carried[left + 1])) break;
      expected.insert(expected.end(), {first.row, second.row});
    }
    ReducedBasis traded = whole;
    TradeForCorrections(&traded);
    ASSERT_EQ(traded.corrected, expected) << trial;
    const auto left = whole.basis.rows() - static_cast<Eigen::Index>(expected.size());
    EXPECT_EQ(traded.basis, whole.basis.topRows(left));
    EXPECT_EQ(traded.head, whole.head.leftCols(left));
    EXPECT_EQ(traded.coefficients.weight, whole.coefficients.weight.topRows(left));
    EXPECT_EQ(traded.coefficients.bias, whole.coefficients.bias.head(left));
    ++pairs.at(std::min<size_t>(expected.size() / 2, 4));
  }
  for (size_t i = 0; i < pairs.size(); ++i) EXPECT_GT(pairs[i], 2u) << i << " pairs are too rare";
}

TEST(CorrectTest, AddedRowsAreTheWorstByHand) {
  std::mt19937 random(4);
  for (int trial = 0; trial < 300; ++trial) {
    const ReducedBasis whole = Any(&random);
    const std::vector<Loss> losses = LossesByHand(whole.basis);
    double all = 0;
    for (const Loss& loss : losses) all += loss.squared;
    for (const double share : {1.01, 0.6, 0.1, 1e-3}) {
      for (const size_t most : {size_t{0}, size_t{1}, size_t{2}, size_t{4}, size_t{7}, size_t{100}}) {
        std::vector<uint32_t> expected;
        double left = all;
        while (left > share * all && expected.size() + 2 <= std::min(most, losses.size())) {
          for (int i = 0; i < 2; ++i) {
            left -= losses[expected.size()].squared;
            expected.push_back(losses[expected.size()].row);
          }
        }
        ReducedBasis reduced = whole;
        AddCorrections(share * all, most, &reduced);
        ASSERT_EQ(reduced.corrected, expected) << trial << " " << share << " " << most;
        EXPECT_EQ(reduced.basis, whole.basis);
      }
    }
  }
}

// Nothing is lost of zeros, and rows that lose the same are taken in their order.
TEST(CorrectTest, EqualLossesAreTakenInOrderAndNoneIsNotTaken) {
  ReducedBasis zeros = Steep();
  zeros.basis.setZero();
  ReducedBasis traded = zeros;
  TradeForCorrections(&traded);
  EXPECT_EQ(traded.basis.rows(), 12);
  AddCorrections(0, 12, &zeros);
  EXPECT_TRUE(zeros.corrected.empty());
  ReducedBasis same = Steep(1.0);
  same.basis.rowwise() = same.basis.row(0).eval();
  AddCorrections(0, 4, &same);
  EXPECT_EQ(same.corrected, (std::vector<uint32_t>{0, 1, 2, 3}));
}

// Stored rows stand for `exact` with what int8 leaves of each: first as without remainders, then these.
TEST(CorrectTest, RemaindersAreRowsByHand) {
  std::mt19937 random(5);
  for (int trial = 0; trial < 50; ++trial) {
    const ReducedBasis whole = Any(&random);
    const auto rows = static_cast<uint32_t>(whole.basis.rows());
    std::vector<uint32_t> corrected;
    for (uint32_t j = 0; j < rows; ++j) {
      if (random() % 2 == 0) corrected.insert(corrected.begin(), j);
    }
    const QuantizedMatrix plain = QuantizeTwoSided("b", whole.basis);
    const CorrectedMatrix result = QuantizeCorrected("b", whole.basis, corrected);
    const QuantizedMatrix& stored = result.stored;
    ASSERT_EQ(stored.rows, rows + corrected.size());
    ASSERT_EQ(stored.row_scales.size(), stored.rows);
    ASSERT_EQ(stored.values.size(), stored.rows * stored.columns);
    ASSERT_EQ(static_cast<size_t>(result.exact.rows()), stored.rows);
    EXPECT_EQ(stored.column_scales, plain.column_scales);
    for (size_t j = 0; j < stored.rows; ++j) {
      const size_t from = j < rows ? j : corrected[j - rows];
      const bool is_corrected = std::find(corrected.begin(), corrected.end(), from) != corrected.end();
      for (size_t c = 0; c < stored.columns; ++c) {
        const auto column = static_cast<Eigen::Index>(c);
        const auto exact = static_cast<double>(whole.basis(static_cast<Eigen::Index>(from), column));
        const double rest = exact - Value(plain, from, c);
        const auto stands_for = static_cast<double>(result.exact(static_cast<Eigen::Index>(j), column));
        if (j >= rows) {
          EXPECT_EQ(stands_for, static_cast<double>(static_cast<float>(rest)));
          const double step = static_cast<double>(stored.row_scales[j]) * static_cast<double>(stored.column_scales[c]);
          EXPECT_EQ(stored.row_scales[j], plain.row_scales[from] / 254);
          EXPECT_EQ(stored.values[j * stored.columns + c], std::clamp(std::nearbyint(rest / step), -127.0, 127.0));
        } else {
          EXPECT_EQ(stored.values[j * stored.columns + c], plain.values[j * stored.columns + c]);
          const float without = static_cast<float>(exact) - static_cast<float>(rest);
          EXPECT_EQ(stands_for, is_corrected ? static_cast<double>(without) : exact);
        }
      }
    }
  }
}

TEST(CorrectTest, CopiesFollowTheirRows) {
  ReducedBasis reduced = Steep();
  reduced.corrected = {7, 2};
  const Matrix head = HeadWithCopies(reduced);
  const LinearWeights linear = CoefficientsWithCopies(reduced);
  ASSERT_EQ(head.cols(), 14);
  ASSERT_EQ(linear.weight.rows(), 14);
  ASSERT_EQ(linear.bias.size(), 14);
  for (Eigen::Index j = 0; j < 14; ++j) {
    const Eigen::Index from = j < 12 ? j : j == 12 ? 7 : 2;
    EXPECT_EQ(head.col(j), reduced.head.col(from)) << j;
    EXPECT_EQ(linear.weight.row(j), reduced.coefficients.weight.row(from)) << j;
    EXPECT_EQ(linear.bias[j], reduced.coefficients.bias[from]) << j;
  }
  reduced.coefficients = {};
  EXPECT_EQ(CoefficientsWithCopies(reduced).weight.size(), 0);
}

}  // namespace
}  // namespace dcloth::converter
