#include <cstring>
#include <limits>

#include "kernels/activation/tanh_rational.h"
#include "kernels/half.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

constexpr uint32_t kInfinityBits = 0x7F800000;

// Finite floats of both signs: every 769th of all (a prime: 2.8 million a sign), and every one within [7.8, 8.1], where
// both clamps lie, and within [15.6, 16.2], where the logistic function has its own.
std::vector<float> Sweep() {
  std::vector<float> values;
  const auto add = [&values](uint32_t bits) {
    values.push_back(FloatFromBits(bits));
    values.push_back(-FloatFromBits(bits));
  };
  for (uint32_t bits = 0; bits < kInfinityBits; bits += 769) add(bits);
  for (uint32_t bits = BitsFromFloat(7.8f); bits <= BitsFromFloat(8.1f); ++bits) add(bits);
  for (uint32_t bits = BitsFromFloat(15.6f); bits <= BitsFromFloat(16.2f); ++bits) add(bits);
  return values;
}

class ActivationTest : public KernelTest {
 protected:
  std::vector<float> Tanh(const std::vector<float>& x) {
    std::vector<float> y(x.size());
    table().tanh({x.data(), y.data(), x.size()});
    return y;
  }
  std::vector<float> Sigmoid(const std::vector<float>& x) {
    std::vector<float> y(x.size());
    table().sigmoid({x.data(), y.data(), x.size()});
    return y;
  }
};
DCLOTH_TEST_EVERY_TABLE(ActivationTest);

TEST_P(ActivationTest, TanhIsWithinItsStatedErrorOddAndBounded) {
  const std::vector<float> x = Sweep();
  const std::vector<float> y = Tanh(x);
  double worst = 0;
  for (size_t i = 0; i < x.size(); i += 2) {
    worst = std::max(worst, std::fabs(y[i] - std::tanh(static_cast<double>(x[i]))));
    ASSERT_LE(y[i], 1.0f) << x[i];
    ASSERT_EQ(y[i + 1], -y[i]) << x[i];
    if (x[i] >= kTanhClampWithFma) {
      ASSERT_EQ(y[i], 1.0f) << x[i];
    }
  }
  EXPECT_LE(worst, kTanhMaxError) << table().name;
  RecordProperty("worst_error", std::to_string(worst * 1e7) + "e-7");
}

TEST_P(ActivationTest, SigmoidIsWithinItsStatedErrorAndBounded) {
  const std::vector<float> x = Sweep();
  const std::vector<float> y = Sigmoid(x);
  double worst = 0;
  for (size_t i = 0; i < x.size(); ++i) {
    worst = std::max(worst, std::fabs(y[i] - 1 / (1 + std::exp(-static_cast<double>(x[i])))));
    ASSERT_TRUE(y[i] >= 0.0f && y[i] <= 1.0f) << x[i];
    if (x[i] >= 2 * kTanhClampWithFma) {
      ASSERT_EQ(y[i], 1.0f) << x[i];
    }
    if (x[i] <= -2 * kTanhClampWithFma) {
      ASSERT_EQ(y[i], 0.0f) << x[i];
    }
  }
  EXPECT_LE(worst, kSigmoidMaxError) << table().name;
  RecordProperty("worst_error", std::to_string(worst * 1e7) + "e-7");
}

TEST_P(ActivationTest, InfinitiesSaturateAndNanPropagates) {
  const float infinity = std::numeric_limits<float>::infinity();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  // Nine of each, so that both whole vectors and the remainder meet them.
  for (size_t count : {1, 9, 17}) {
    for (float y : Tanh(std::vector<float>(count, infinity))) EXPECT_EQ(y, 1.0f);
    for (float y : Tanh(std::vector<float>(count, -infinity))) EXPECT_EQ(y, -1.0f);
    for (float y : Tanh(std::vector<float>(count, nan))) EXPECT_TRUE(std::isnan(y)) << table().name;
    for (float y : Sigmoid(std::vector<float>(count, infinity))) EXPECT_EQ(y, 1.0f);
    for (float y : Sigmoid(std::vector<float>(count, -infinity))) EXPECT_EQ(y, 0.0f);
    for (float y : Sigmoid(std::vector<float>(count, nan))) EXPECT_TRUE(std::isnan(y)) << table().name;
  }
}

TEST_P(ActivationTest, EverySizeStaysInsideItsArrays) {
  for (size_t count : InterestingSizes()) {
    Random random(static_cast<uint32_t>(count));
    const GuardedBuffer<float> x(random.Floats(count, -9.0f, 9.0f));
    GuardedBuffer<float> y(count);
    table().tanh({x.data(), y.data(), count});
    for (size_t i = 0; i < count; ++i) ASSERT_LE(std::fabs(y[i] - std::tanh(double{x[i]})), kTanhMaxError);
    ASSERT_TRUE(y.SlackUntouched());
    y.Poison();
    table().sigmoid({x.data(), y.data(), count});
    for (size_t i = 0; i < count; ++i) ASSERT_LE(std::fabs(y[i] - ExactSigmoid(x[i])), kSigmoidMaxError);
    // In place.
    std::copy_n(x.data(), count, y.data());
    table().tanh({y.data(), y.data(), count});
    for (size_t i = 0; i < count; ++i) ASSERT_LE(std::fabs(y[i] - std::tanh(double{x[i]})), kTanhMaxError);
  }
}

}  // namespace
}  // namespace dcloth::kernels
