#include <cstring>

#include "kernels/activation/tanh_rational.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

class GruTest : public KernelTest {};
DCLOTH_TEST_EVERY_TABLE(GruTest);

TEST_P(GruTest, EverySizeStaysWithinTheBound) {
  for (size_t k : InterestingSizes()) {
    SCOPED_TRACE(testing::Message() << table().name << " k " << k);
    Random random(static_cast<uint32_t>(k));
    const GuardedBuffer<float> gx(random.Floats(3 * k, -4.0f, 4.0f)), gh(random.Floats(3 * k, -4.0f, 4.0f));
    const std::vector<float> before = random.Floats(k, -1.0f, 1.0f);
    GuardedBuffer<float> h(before);
    table().gru_gates({gx.data(), gh.data(), h.data(), k});
    ASSERT_TRUE(h.SlackUntouched());
    std::vector<float> reference = before;
    scalar::GruGates({gx.data(), gh.data(), reference.data(), k});
    ASSERT_EQ(std::memcmp(h.data(), reference.data(), k * sizeof(float)), 0);
    for (size_t i = 0; i < k; ++i) {
      const double r_in = double{gx[i]} + gh[i], z_in = double{gx[k + i]} + gh[k + i];
      const double r = ExactSigmoid(r_in), z = ExactSigmoid(z_in);
      const double q_in = gx[2 * k + i] + r * gh[2 * k + i];
      const double q = std::tanh(q_in);
      const double exact = (1 - z) * q + z * before[i];
      // Slopes: the logistic function 1/4, tanh 1. One rounding of each sum, two of q's argument, two of the blend.
      const double r_error = kSigmoidMaxError + kUnit * std::fabs(r_in) / 4;
      const double z_error = kSigmoidMaxError + kUnit * std::fabs(z_in) / 4;
      const double gh_q = std::fabs(gh[2 * k + i]);
      const double q_error = kTanhMaxError + gh_q * r_error + Gamma(2) * (std::fabs(gx[2 * k + i]) + gh_q);
      const double bound =
          q_error + z_error * (2 + q_error) + Gamma(3) * (2 * std::fabs(q) + std::fabs(before[i]) + q_error);
      ASSERT_LE(std::fabs(h[i] - exact), bound) << i;
      ASSERT_LE(bound, 1e-5);
    }
  }
}

}  // namespace
}  // namespace dcloth::kernels
