#include "kernels/matvec/quantize.h"

#include <cstring>
#include <limits>

#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

class QuantizeTest : public KernelTest {
 protected:
  // Checks the contract and equality with the scalar reference; returns the scale.
  float Check(const std::vector<float>& x_values, const std::vector<float>& scale_values) {
    const size_t rows = x_values.size();
    const GuardedBuffer<float> x(x_values), row_scales(scale_values);
    GuardedBuffer<int16_t> q(PairedRows(rows)), reference(PairedRows(rows));
    float scale = 0.0f, reference_scale = 0.0f;
    const float* scales = scale_values.empty() ? nullptr : row_scales.data();
    table().quantize_i16({x.data(), scales, q.data(), &scale, rows});
    scalar::QuantizeI16({x.data(), scales, reference.data(), &reference_scale, rows});

    EXPECT_EQ(scale, reference_scale);
    EXPECT_EQ(std::memcmp(q.data(), reference.data(), q.size() * sizeof(int16_t)), 0) << table().name << " " << rows;
    EXPECT_TRUE(q.SlackUntouched());
    int exponent = 0;
    const float eighths = 8 * std::frexp(scale, &exponent);
    EXPECT_EQ(eighths, std::round(eighths)) << "not 4, 5, 6 or 7 times a power of two: " << scale;
    int64_t sum = 0;
    for (size_t j = 0; j < q.size(); ++j) {
      EXPECT_LE(std::abs(int{q[j]}), 32767);
      sum += std::abs(int{q[j]});
      if (j >= rows) {
        EXPECT_EQ(q[j], 0);
        continue;
      }
      const float product = scales != nullptr ? x[j] * row_scales[j] : x[j];
      const double exact = std::isfinite(product) ? product / double{scale} : 0.0;
      EXPECT_LE(std::fabs(q[j] - exact), 0.5 + std::ldexp(std::fabs(exact), -22))
          << table().name << " row " << j << " of " << rows;
    }
    EXPECT_LT(128 * sum, int64_t{1} << 31) << "int32 would overflow with weights of -128";
    return scale;
  }
};
DCLOTH_TEST_EVERY_TABLE(QuantizeTest);

TEST_P(QuantizeTest, EverySize) {
  for (size_t rows : InterestingSizes()) {
    Random random(static_cast<uint32_t>(rows));
    Check(random.Floats(rows, -3.0f, 3.0f), random.Floats(rows, 1e-4f, 1e-2f));
    Check(random.Floats(rows, -3.0f, 3.0f), {});
  }
}

TEST_P(QuantizeTest, AllZeroHasScaleOne) { EXPECT_EQ(Check({0.0f, -0.0f, 0.0f}, {}), 1.0f); }

TEST_P(QuantizeTest, TheScaleIsTheSmallestThatFits) {
  EXPECT_EQ(Check({32767.0f}, {}), 1.0f);
  EXPECT_EQ(Check({32767.498f}, {}), 1.0f);
  EXPECT_EQ(Check({32767.5f}, {}), 1.25f);  // would round to 32768
  EXPECT_EQ(Check({40958.0f}, {}), 1.25f);
  EXPECT_EQ(Check({40960.0f}, {}), 1.5f);
  EXPECT_EQ(Check({49152.0f}, {}), 1.75f);
  EXPECT_EQ(Check({57344.0f}, {}), 2.0f);
  EXPECT_EQ(Check({-28672.0f, 1.0f}, {}), 1.0f);
  EXPECT_EQ(Check({-28670.0f, 1.0f}, {}), 0.875f);
  EXPECT_EQ(Check({16383.5f, 1.0f}, {}), 0.5f);
  EXPECT_EQ(Check({16383.99f, 1.0f}, {}), 0.625f);  // would round to 32768 at 0.5
  // 512 * 32767 = 2^24 - 512 fits the sum; two rows more do not.
  EXPECT_EQ(Check(std::vector<float>(512, 32767.0f), {}), 1.0f);
  EXPECT_EQ(Check(std::vector<float>(514, 32767.0f), {}), 2.0f);
}

TEST_P(QuantizeTest, TheSumMayReachItsLimitButNotPassIt) {
  std::vector<float> x(513, 32767.0f);
  x.back() = static_cast<float>(kQuantizedSumLimit - 512 * 32767);
  EXPECT_EQ(Check(x, {}), 1.0f);
  x.back() += 1.0f;
  EXPECT_EQ(Check(x, {}), 2.0f);
}

// What a coarser step is proven by: ((sum + 513) >> 1) + 1 + 513 may be the limit, for 1,025 rows.
TEST_P(QuantizeTest, TheStepIsTheFinestThatIsProven) {
  const int64_t most = 2 * (kQuantizedSumLimit - 1 - 513) + 1 - 513;
  std::vector<float> x(1025, 32767.0f);
  x[1024] = 0;
  x[1023] = static_cast<float>(most - 1023 * 32767);
  ASSERT_TRUE(x[1023] > 0 && x[1023] < 32767);
  EXPECT_EQ(Check(x, {}), 2.0f);
  x[1024] = 1;
  EXPECT_EQ(Check(x, {}), 4.0f);
}

TEST_P(QuantizeTest, NoSumOverflowsAtTheExtremes) {
  for (size_t rows : {513, 1025, 7952, 65535}) {
    Check(std::vector<float>(rows, -32767.0f), {});
    Check(std::vector<float>(rows, 1.0f), {});
    std::vector<float> one_peak(rows, 0.49f);
    one_peak[rows / 2] = 32767.0f;
    Check(one_peak, {});
    one_peak.assign(rows, 0.5001f);
    one_peak[rows / 2] = 32767.0f;
    Check(one_peak, {});
  }
  Check(std::vector<float>(kMaxQuantizedRows, 3.4e38f), {});
}

TEST_P(QuantizeTest, TinyHugeAndNonFiniteValues) {
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Check({3.4e38f, -3.4e38f, 1.0f}, {});
  Check({1e-30f, -1e-38f, 1e-44f}, {});
  Check({infinity, nan, 2.0f, -infinity, 1.0f, nan, nan, infinity, 3.0f}, {});
  Check({3e38f, 1.0f}, {10.0f, 1.0f});  // the product overflows and counts as zero
}

}  // namespace
}  // namespace dcloth::kernels
