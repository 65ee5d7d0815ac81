#include <cstring>

#include "kernels/matvec/matvec_pack.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

struct Case {
  size_t rows;
  size_t columns;
  size_t row_count;
  bool bias;
  bool relu;
};

class MatvecI8Test : public KernelTest {
 protected:
  // Against int64, and to the bit against the scalar reference. `extreme` takes the largest inputs that the contract
  // allows.
  void Check(const Case& c, bool extreme = false) {
    SCOPED_TRACE(testing::Message() << table().name << " rows " << c.rows << " columns " << c.columns << " count "
                                    << c.row_count);
    Random random(static_cast<uint32_t>(c.rows * 131 + c.columns));
    std::vector<int8_t> source(c.rows * c.columns);
    for (int8_t& w : source) w = static_cast<int8_t>(extreme ? -128 : static_cast<int>(random.Below(256)) - 128);
    GuardedBuffer<int8_t> weights(PairPanelElements(c.rows, c.columns), Place::kAligned64);
    PackPairPanelsI8(source.data(), {c.rows, c.columns, c.columns, 1}, weights.data());
    GuardedBuffer<int16_t> x(c.row_count);
    // 128 * sum|x| < 2^31
    const int limit = std::min<int>(32767, ((1 << 24) - 1) / static_cast<int>(std::max<size_t>(c.row_count, 1)));
    for (size_t j = 0; j < c.row_count; ++j) {
      x[j] = static_cast<int16_t>(extreme ? limit : static_cast<int>(random.Below(2 * limit + 1)) - limit);
    }
    const size_t padded = PaddedColumns(c.columns);
    const GuardedBuffer<float> scales(random.Floats(padded, 1e-6f, 1e-3f), Place::kAligned64);
    const GuardedBuffer<float> bias(random.Floats(padded, -1.0f, 1.0f));
    GuardedBuffer<float> y(padded + 1), reference(padded + 1);
    MatvecI8Job job = {x.data(), weights.data(),     scales.data(), c.bias ? bias.data() : nullptr, y.data(),
                       0x1p-10f, PairedRows(c.rows), c.row_count,   PanelCount(c.columns),          c.relu};
    table().matvec_i8(job);
    job.y = reference.data();
    scalar::MatvecI8(job);

    ASSERT_EQ(std::memcmp(y.data(), reference.data(), padded * sizeof(float)), 0);
    ASSERT_TRUE(std::isnan(y[padded]));
    ASSERT_TRUE(weights.SlackUntouched() && x.SlackUntouched() && y.SlackUntouched());
    for (size_t column = 0; column < padded; ++column) {
      int64_t sum = 0;
      for (size_t j = 0; column < c.columns && j < c.row_count && j < c.rows; ++j) {
        sum += int64_t{x[j]} * source[j * c.columns + column];
      }
      ASSERT_LT(std::llabs(sum), int64_t{1} << 31);
      const double product = static_cast<double>(sum) * 0x1p-10 * scales[column];
      const double offset = c.bias ? bias[column] : 0.0;
      const double exact = c.relu ? std::max(product + offset, 0.0) : product + offset;
      // Conversion to float, one inexact product and one sum.
      ASSERT_LE(std::fabs(y[column] - exact), Gamma(3) * (std::fabs(product) + std::fabs(offset))) << column;
    }
  }
};
DCLOTH_TEST_EVERY_TABLE(MatvecI8Test);

TEST_P(MatvecI8Test, EverySize) {
  for (size_t size : InterestingSizes()) {
    Check({size, 33, PairedRows(size), true, false});
    Check({38, size, 38, false, true});
  }
  Check({128, 3 * 521, 128, true, true});
}

TEST_P(MatvecI8Test, RowSubsets) {
  for (size_t count : {0, 2, 6, 14, 28}) Check({30, 65, count, count % 4 == 0, false});
}

TEST_P(MatvecI8Test, LargestInputsDoNotOverflow) {
  for (size_t rows : {2, 512, 514, 1024, 7952, 16384}) Check({rows, 32, rows, true, false}, true);
}

// A negative product that falls below the floats is minus zero.
TEST_P(MatvecI8Test, RectifiedZeroIsPositive) {
  GuardedBuffer<int8_t> weights(PairPanelElements(2, kPanelColumns), Place::kAligned64);
  std::fill_n(weights.data(), weights.size(), int8_t{-1});
  const GuardedBuffer<int16_t> x(std::vector<int16_t>{1, 2});
  const GuardedBuffer<float> scales(std::vector<float>(kPanelColumns, 1e-30f), Place::kAligned64);
  GuardedBuffer<float> y(kPanelColumns);
  for (const bool relu : {false, true}) {
    table().matvec_i8({x.data(), weights.data(), scales.data(), nullptr, y.data(), 1e-30f, 2, 2, 1, relu});
    for (size_t c = 0; c < kPanelColumns; ++c) {
      EXPECT_EQ(y[c], 0.0f);
      EXPECT_NE(std::signbit(y[c]), relu) << table().name;
    }
  }
}

TEST_P(MatvecI8Test, AddsUpWhereTheBiasIsTheResult) {
  constexpr size_t kRows = 38, kColumns = 96;
  Random random(7);
  GuardedBuffer<int8_t> weights(PairPanelElements(kRows, kColumns), Place::kAligned64);
  for (size_t i = 0; i < weights.size(); ++i) weights[i] = static_cast<int8_t>(random.Below(256));
  GuardedBuffer<int16_t> x(kRows);
  for (size_t j = 0; j < kRows; ++j) x[j] = static_cast<int16_t>(random.Below(65536));
  const GuardedBuffer<float> scales(random.Floats(kColumns, 1e-6f, 1e-3f), Place::kAligned64);
  const GuardedBuffer<float> bias(random.Floats(kColumns, -1.0f, 1.0f));
  GuardedBuffer<float> y(kColumns), sum(kColumns);
  std::copy_n(bias.data(), kColumns, sum.data());
  MatvecI8Job job = {x.data(), weights.data(), scales.data(), bias.data(),          y.data(),
                     0x1p-10f, kRows,          kRows,         PanelCount(kColumns), true};
  table().matvec_i8(job);
  job.bias = job.y = sum.data();
  table().matvec_i8(job);
  EXPECT_EQ(std::memcmp(y.data(), sum.data(), kColumns * sizeof(float)), 0) << table().name;
}

TEST(MatvecPackI8, PutsElementsWhereTheSchemaSays) {
  constexpr size_t kRows = 5, kColumns = 40;
  std::vector<int8_t> source(kRows * kColumns);
  for (size_t i = 0; i < source.size(); ++i) source[i] = static_cast<int8_t>(i % 127 + 1);
  std::vector<int8_t> packed(PairPanelElements(kRows, kColumns), -1);
  ASSERT_EQ(packed.size(), 2u * 3 * 32 * 2);
  PackPairPanelsI8(source.data(), {kRows, kColumns, kColumns, 1}, packed.data());
  for (size_t j = 0; j < 6; ++j) {
    for (size_t c = 0; c < 64; ++c) {
      const int expected = j < kRows && c < kColumns ? source[j * kColumns + c] : 0;
      ASSERT_EQ(packed[((c / 32 * 3 + j / 2) * 32 + c % 32) * 2 + j % 2], expected) << j << " " << c;
    }
  }
}

}  // namespace
}  // namespace dcloth::kernels
