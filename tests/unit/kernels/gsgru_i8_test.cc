#include "kernels/gsgru/gsgru_i8.h"

#include <memory>
#include <string>

#include "tests/unit/kernels/gsgru_i8_oracle.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

using Floats = GuardedBuffer<float>;

TEST(CoarseTanhTest, StaysWithinItsErrorAndBelowOne) {
  double largest = 0, sigmoid = 0;
  for (int i = 0; i <= 1 << 20; ++i) {
    const float x = 9.0f * static_cast<float>(i) / (1 << 20);
    for (const float side : {x, -x}) {
      const scalar::Fraction t = scalar::CoarseTanh(side), s = scalar::CoarseSigmoid(side);
      ASSERT_LT(std::fabs(t.p), t.q) << side;
      ASSERT_GE(t.q, 1.0f);
      largest = std::max(largest, std::fabs(double{t.p / t.q} - std::tanh(double{side})));
      sigmoid = std::max(sigmoid, std::fabs(double{s.p / s.q} - ExactSigmoid(double{side})));
    }
  }
  EXPECT_LE(largest, kCoarseTanhMaxError);
  EXPECT_GE(largest, 0.9 * kCoarseTanhMaxError) << "the stated error is too large to mean anything";
  EXPECT_LE(sigmoid, kCoarseSigmoidMaxError);
}

class GsgruI8Test : public KernelTest {
 protected:
  void Check(size_t vertices, size_t features, size_t input_width, bool embed) {
    SCOPED_TRACE(testing::Message() << table().name << " n " << vertices << " F " << features << " width "
                                    << input_width << " embed " << embed);
    Random random(static_cast<uint32_t>(vertices * 1000 + features * 10 + input_width));
    const Graph graph(vertices, random);
    const GuardedBuffer<uint32_t> row_starts(graph.row_starts);
    const GuardedBuffer<uint16_t> columns(graph.columns);
    const size_t w = input_width, F = features, stride = GsgruInputStride(w), wide = GsgruI8Columns(w, F);
    const auto floats = [&](size_t count, float low, float high) {
      return std::make_unique<Floats>(random.Floats(count, low, high), Place::kAligned64);
    };
    Floats x(vertices * stride, Place::kAligned64);
    for (size_t i = 0; i < x.size(); ++i) {
      if (i % stride < w) x[i] = random.Uniform(-1, 1);  // the padding stays NaN
    }
    const auto points = floats(3 * 3 * F, -0.5f, 0.5f), gate_bias = floats(3 * F, -1, 1),
               output_bias = floats(F, -1, 1), gain = floats(F, -1, 1), offset = floats(F, -1, 1),
               embedding = floats(F, -0.3f, 0.3f);
    const float size = 1.0f / (127.0f * kGsgruHiddenLevels * std::sqrt(static_cast<float>(F)));
    const auto scales = floats(wide, size / 2, size), steps = floats(F, 25000, 32000);
    GuardedBuffer<int8_t> weights(F * wide, Place::kAligned64);
    for (size_t i = 0; i < weights.size(); ++i)
      weights[i] = static_cast<int8_t>(static_cast<int>(random.Below(255)) - 127);
    const std::vector<float> before = random.Floats(GsgruStateFloats(vertices, F), -1, 1);
    Floats state(before, Place::kAligned64), scratch(GsgruI8ScratchFloats(F), Place::kAligned64);
    Floats next_x(vertices * F, Place::kAligned64), s(vertices);
    const GsgruJob layer = {x.data(),
                            row_starts.data(),
                            columns.data(),
                            w == 3 ? points->data() : nullptr,
                            gate_bias->data(),
                            nullptr,
                            nullptr,
                            nullptr,
                            output_bias->data(),
                            gain->data(),
                            offset->data(),
                            embed ? embedding->data() : nullptr,
                            state.data(),
                            embed ? nullptr : next_x.data(),
                            embed ? s.data() : nullptr,
                            scratch.data(),
                            vertices,
                            w,
                            F,
                            0.25f,
                            0.125f};
    const GsgruI8Job job = {layer, weights.data(), scales->data(), w == 3 ? nullptr : steps->data()};
    table().gsgru_i8(job);

    ASSERT_TRUE(state.SlackUntouched() && scratch.SlackUntouched() && next_x.SlackUntouched() && s.SlackUntouched());
    double widest = 0;
    for (size_t i = 0; i < vertices; ++i) {
      const GsgruExpected expected = ExpectGsgruI8(job, i, before.data() + i * F);
      for (size_t f = 0; f < F; ++f) {
        const Bounded h = expected.state[f], next = expected.next_x[f];
        ASSERT_LE(std::fabs(state[i * F + f] - h.value), h.error) << "h' " << i << " " << f;
        if (!embed) {
          ASSERT_LE(std::fabs(next_x[i * F + f] - next.value), next.error) << i << " " << f;
        }
        if (i != Graph::kHub) widest = std::max(widest, h.error);
      }
      if (embed) {
        ASSERT_LE(std::fabs(s[i] - expected.s.value), expected.s.error) << "s " << i;
      }
    }
    ASSERT_LE(widest, 5e-4) << "the bound has become too wide to test anything";
  }
};
DCLOTH_TEST_EVERY_TABLE(GsgruI8Test);

TEST_P(GsgruI8Test, EveryVertexCount) {
  for (size_t vertices = 1; vertices <= 70; ++vertices) {
    Check(vertices, 16, vertices % 2 == 0 ? 16 : 3, vertices % 3 == 0);
  }
}

TEST_P(GsgruI8Test, EveryFeatureWidth) {
  for (size_t features = 8; features <= kGsgruMaxFeatures; features += 8) {
    for (size_t vertices : {1, 5, 16, 19}) {
      Check(vertices, features, features, false);
      Check(vertices, features, 3, false);
      Check(vertices, features, features, true);
    }
  }
}

// Every input beyond the last level is the last level, however far beyond: a stranger's scales may say anything.
TEST_P(GsgruI8Test, InputsFarBeyondTheLastLevelSaturate) {
  if (std::string(table().name) == "neon") GTEST_SKIP() << "multiplies floats, which are not rounded";
  constexpr size_t kF = 8, kVertices = 3;
  Random random(7);
  const GuardedBuffer<uint32_t> row_starts(std::vector<uint32_t>{0, 1, 2, 3});
  const GuardedBuffer<uint16_t> columns(std::vector<uint16_t>{0, 1, 2});
  const Floats bias(std::vector<float>(3 * kF, 0.1f), Place::kAligned64),
      output_bias(random.Floats(kF, -1, 1), Place::kAligned64), gain(random.Floats(kF, -1, 1), Place::kAligned64),
      offset(random.Floats(kF, -1, 1), Place::kAligned64),
      scales(random.Floats(7 * kF, 1e-7f, 2e-7f), Place::kAligned64),
      steps(std::vector<float>(kF, 2.0f), Place::kAligned64);
  GuardedBuffer<int8_t> weights(kF * 7 * kF, Place::kAligned64);
  for (size_t i = 0; i < weights.size(); ++i)
    weights[i] = static_cast<int8_t>(static_cast<int>(random.Below(255)) - 127);
  const std::vector<float> before = random.Floats(GsgruStateFloats(kVertices, kF), -1, 1);
  const auto run = [&](float input) {
    const Floats x(std::vector<float>(kVertices * kF, input), Place::kAligned64);
    Floats state(before, Place::kAligned64), scratch(GsgruI8ScratchFloats(kF), Place::kAligned64),
        next(kVertices * kF, Place::kAligned64);
    const GsgruJob layer = {x.data(),
                            row_starts.data(),
                            columns.data(),
                            nullptr,
                            bias.data(),
                            nullptr,
                            nullptr,
                            nullptr,
                            output_bias.data(),
                            gain.data(),
                            offset.data(),
                            nullptr,
                            state.data(),
                            next.data(),
                            nullptr,
                            scratch.data(),
                            kVertices,
                            kF,
                            kF,
                            0.25f,
                            0.0f};
    table().gsgru_i8({layer, weights.data(), scales.data(), steps.data()});
    std::vector<float> out(state.data(), state.data() + kVertices * kF);
    out.insert(out.end(), next.data(), next.data() + kVertices * kF);
    return out;
  };
  const std::vector<float> lowest = run(-16384.0f), highest = run(16383.5f);  // -32768 and 32767
  ASSERT_NE(lowest, highest);
  for (const float input : {-16500.0f, -2e6f, -3.2e6f, -6.4e6f, -8e6f, -1e7f, -1.3e7f, -1e9f, -1e20f, -1.5e38f}) {
    EXPECT_EQ(run(input), lowest) << table().name << " " << input;
    EXPECT_EQ(run(-input), highest) << table().name << " " << -input;
  }
  EXPECT_EQ(run(std::nanf("")), lowest) << table().name;
  EXPECT_EQ(run(-std::nanf("")), lowest) << table().name;
}

TEST_P(GsgruI8Test, LargeGraph) { Check(1021, 32, 32, false); }

}  // namespace
}  // namespace dcloth::kernels
