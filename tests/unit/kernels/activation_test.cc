#include <cstring>
#include <limits>

#include "kernels/activation/tanh_rational.h"
#include "kernels/half.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

constexpr uint32_t kInfinityBits = 0x7F800000;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

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

// Through the GRU's gates, h' = (1 - z) q + z h: with z = 0 and h = 0 it is tanh of the candidate's input, with a
// candidate of 0 and h = 1 the logistic function of the gate's.
class ActivationTest : public KernelTest {
 protected:
  std::vector<float> Gates(const std::vector<float>& gx, std::vector<float> h) {
    const std::vector<float> gh(gx.size(), 0.0f);
    table().gru_gates({gx.data(), gh.data(), h.data(), h.size()});
    return h;
  }
  std::vector<float> Tanh(const std::vector<float>& x) {
    std::vector<float> gx(3 * x.size(), 0.0f), h(x.size(), 0.0f);
    std::fill_n(gx.begin() + static_cast<std::ptrdiff_t>(x.size()), x.size(), -kInfinity);
    std::copy(x.begin(), x.end(), gx.end() - static_cast<std::ptrdiff_t>(x.size()));
    return Gates(gx, h);
  }
  std::vector<float> Sigmoid(const std::vector<float>& x) {
    std::vector<float> gx(3 * x.size(), 0.0f), h(x.size(), 1.0f);
    std::copy(x.begin(), x.end(), gx.begin() + static_cast<std::ptrdiff_t>(x.size()));
    return Gates(gx, h);
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

}  // namespace
}  // namespace dcloth::kernels
