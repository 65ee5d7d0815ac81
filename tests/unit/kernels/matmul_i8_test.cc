#include <cstring>

#include "kernels/matvec/matvec_pack.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

struct Case {
  size_t count;
  size_t rows;
  size_t columns;
  size_t row_count;
  bool bias = true;
  bool relu = false;
  size_t x_gap = 0;  // elements between two rows
  size_t y_gap = 0;
};

class MatmulI8Test : public KernelTest {
 protected:
  // To the bit against the scalar references of one input, which matvec_i8_test holds to the truth. `extreme` takes the
  // largest inputs that the contract allows.
  void Check(const Case& c, bool extreme = false) {
    SCOPED_TRACE(testing::Message() << table().name << " count " << c.count << " rows " << c.rows << " columns "
                                    << c.columns << " row_count " << c.row_count);
    Random random(static_cast<uint32_t>(c.count * 7919 + c.rows * 131 + c.columns));
    const size_t padded = PaddedColumns(c.columns), panels = PanelCount(c.columns);
    std::vector<int8_t> source(c.rows * c.columns);
    for (int8_t& w : source) w = static_cast<int8_t>(extreme ? -128 : static_cast<int>(random.Below(256)) - 128);
    GuardedBuffer<int8_t> weights(PairPanelElements(c.rows, c.columns), Place::kAligned64);
    PackPairPanelsI8(source.data(), {c.rows, c.columns, c.columns, 1}, weights.data());
    const GuardedBuffer<float> scales(random.Floats(padded, 1e-6f, 1e-3f), Place::kAligned64);
    const GuardedBuffer<float> bias(random.Floats(padded, -1.0f, 1.0f)), x_scales(random.Floats(c.count, 1e-4f, 1e-2f));
    // The last rows touch the guard page.
    const size_t x_stride = c.row_count + c.x_gap, y_stride = padded + c.y_gap;
    GuardedBuffer<int16_t> x(c.count == 0 ? 0 : c.count * x_stride - c.x_gap);
    GuardedBuffer<float> y(c.count == 0 ? 0 : c.count * y_stride - c.y_gap);
    const int limit = std::min<int>(32767, ((1 << 24) - 1) / static_cast<int>(std::max<size_t>(c.row_count, 1)));
    for (size_t j = 0; j < x.size(); ++j) {
      x[j] = static_cast<int16_t>(extreme ? limit : static_cast<int>(random.Below(2 * limit + 1)) - limit);
    }
    const float* const offset = c.bias ? bias.data() : nullptr;
    x.MakeReadOnly();
    weights.MakeReadOnly();
    table().matmul_i8({x.data(), x_scales.data(), weights.data(), scales.data(), offset, y.data(), c.count, x_stride,
                       y_stride, PairedRows(c.rows), c.row_count, panels, c.relu});
    ASSERT_TRUE(y.SlackUntouched());
    std::vector<float> reference(padded);
    for (size_t i = 0; i < c.count; ++i) {
      scalar::MatvecI8({x.data() + i * x_stride, weights.data(), scales.data(), offset, reference.data(), x_scales[i],
                        PairedRows(c.rows), c.row_count, panels, c.relu});
      const float* row = y.data() + i * y_stride;
      ASSERT_EQ(std::memcmp(row, reference.data(), padded * sizeof(float)), 0) << "input " << i;
      for (size_t k = padded; k < y_stride && i + 1 < c.count; ++k) ASSERT_TRUE(std::isnan(row[k])) << "input " << i;
    }
  }
};
DCLOTH_TEST_EVERY_TABLE(MatmulI8Test);

// Blocks of inputs that are full, that are not, and no input.
TEST_P(MatmulI8Test, EveryCount) {
  for (size_t count = 0; count <= 50; ++count) Check({count, 38, 65, 38, count % 2 == 0, count % 3 == 0});
}

TEST_P(MatmulI8Test, EverySize) {
  for (size_t size : InterestingSizes()) {
    Check({5, size, 33, PairedRows(size)});
    Check({9, 38, size, 38, false, true});
  }
}

TEST_P(MatmulI8Test, RowSubsetsAndStrides) {
  for (size_t row_count : {0, 2, 6, 14, 28}) {
    for (size_t gap : {0, 1, 3, 40}) Check({11, 30, 65, row_count, row_count % 4 == 0, false, gap, 41 - gap});
  }
}

TEST_P(MatmulI8Test, LargestInputsDoNotOverflow) {
  for (size_t rows : {2, 512, 514, 1024}) Check({9, rows, 32, rows}, true);
}

// As a patch stage has them.
TEST_P(MatmulI8Test, RandomShapes) {
  Random random(3);
  for (int round = 0; round < 40; ++round) {
    const size_t rows = 2 * (1 + random.Below(256));
    Check({1 + random.Below(48), rows, 1 + random.Below(768), 2 * random.Below(static_cast<uint32_t>(rows / 2) + 1),
           random.Below(2) == 0, random.Below(2) == 0, random.Below(20), random.Below(20)});
  }
}

// A negative product that falls below the floats is minus zero.
TEST_P(MatmulI8Test, RectifiedZeroIsPositive) {
  GuardedBuffer<int8_t> weights(PairPanelElements(2, kPanelColumns), Place::kAligned64);
  std::fill_n(weights.data(), weights.size(), int8_t{-1});
  const GuardedBuffer<int16_t> x(std::vector<int16_t>{1, 2, 3, 4});
  const GuardedBuffer<float> x_scales(std::vector<float>(2, 1e-30f));
  const GuardedBuffer<float> scales(std::vector<float>(kPanelColumns, 1e-30f), Place::kAligned64);
  for (const bool relu : {false, true}) {
    GuardedBuffer<float> y(2 * kPanelColumns);
    table().matmul_i8({x.data(), x_scales.data(), weights.data(), scales.data(), nullptr, y.data(), 2, 2, kPanelColumns,
                       2, 2, 1, relu});
    for (size_t c = 0; c < y.size(); ++c) {
      EXPECT_EQ(y[c], 0.0f);
      EXPECT_NE(std::signbit(y[c]), relu) << table().name;
    }
  }
}

}  // namespace
}  // namespace dcloth::kernels
