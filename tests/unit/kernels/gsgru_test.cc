#include "kernels/gsgru/gsgru.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "tests/unit/kernels/gsgru_oracle.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

using Floats = GuardedBuffer<float>;

class GsgruTest : public KernelTest {
 protected:
  void Check(size_t vertices, size_t features, size_t input_width, bool embed) {
    SCOPED_TRACE(testing::Message() << table().name << " n " << vertices << " F " << features << " width "
                                    << input_width << " embed " << embed);
    Random random(static_cast<uint32_t>(vertices * 1000 + features * 10 + input_width));
    const Graph graph(vertices, random);
    const GuardedBuffer<uint32_t> row_starts(graph.row_starts);
    const GuardedBuffer<uint16_t> columns(graph.columns);
    const auto weights = [&](size_t rows, size_t cols) {
      const float size = 1.0f / std::sqrt(static_cast<float>(rows));
      return std::make_unique<Floats>(random.Floats(rows * cols, -size, size), Place::kAligned64);
    };
    const size_t w = input_width, F = features, stride = GsgruInputStride(w);
    Floats x(vertices * stride, Place::kAligned64);
    for (size_t i = 0; i < x.size(); ++i) {
      if (i % stride < w) x[i] = random.Uniform(-1.5f, 1.5f);  // the padding stays NaN
    }
    const auto input_gates = weights(w, 3 * F), gate_bias = weights(1, 3 * F), hidden_gates = weights(F, 2 * F),
               candidate = weights(F, F), output = weights(F, F), output_bias = weights(1, F), gain = weights(1, F),
               offset = weights(1, F), embedding = weights(F, 1);
    const std::vector<float> before = random.Floats(GsgruStateFloats(vertices, F), -1.0f, 1.0f);
    Floats state(before, Place::kAligned64), scratch(GsgruScratchFloats(F), Place::kAligned64);
    Floats next_x(vertices * F, Place::kAligned64), s(vertices);
    const GsgruJob job = {x.data(),
                          row_starts.data(),
                          columns.data(),
                          input_gates->data(),
                          gate_bias->data(),
                          hidden_gates->data(),
                          candidate->data(),
                          output->data(),
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
                          0.125f,
                          x.data() + x.size(),
                          192};  // ahead: up to the guard page and beyond
    table().gsgru(job);

    ASSERT_TRUE(state.SlackUntouched() && scratch.SlackUntouched() && next_x.SlackUntouched() && s.SlackUntouched());
    double widest = 0;
    for (size_t i = 0; i < vertices; ++i) {
      const GsgruExpected expected = ExpectGsgru(job, i, before.data() + i * F);
      for (size_t f = 0; f < F; ++f) {
        ASSERT_LE(std::fabs(state[i * F + f] - expected.state[f].value), expected.state[f].error)
            << "h' " << i << " " << f;
        if (!embed) {
          ASSERT_LE(std::fabs(next_x[i * F + f] - expected.next_x[f].value), expected.next_x[f].error) << i << " " << f;
        }
        if (i != Graph::kHub) widest = std::max(widest, expected.state[f].error);
      }
      if (embed) {
        ASSERT_LE(std::fabs(s[i] - expected.s.value), expected.s.error) << "s " << i;
      }
    }
    ASSERT_LE(widest, 1e-4) << "the bound has become too wide to test anything";
  }
};
DCLOTH_TEST_EVERY_TABLE(GsgruTest);

TEST_P(GsgruTest, EveryVertexCount) {
  for (size_t vertices = 1; vertices <= 70; ++vertices) {
    Check(vertices, 8, vertices % 2 == 0 ? 8 : 3, vertices % 3 == 0);
    Check(vertices, 16, vertices % 2 == 0 ? 3 : 16, vertices % 3 == 1);
  }
}

TEST_P(GsgruTest, EveryFeatureWidth) {
  for (size_t features = 8; features <= kGsgruMaxFeatures; features += 8) {
    for (size_t vertices : {1, 5, 16, 19}) {
      Check(vertices, features, features, false);
      Check(vertices, features, 3, false);
      Check(vertices, features, features, true);
    }
  }
}

// Gates of exactly 0 and 1 or a little less, never beyond: over days a state would leave [-1, 1].
TEST_P(GsgruTest, SaturatedGatesKeepTheStateWithinOne) {
  constexpr size_t kVertices = 48;
  for (size_t F : {8, 16, 24}) {
    Random random(static_cast<uint32_t>(F));
    const Graph graph(kVertices, random);
    const GuardedBuffer<uint32_t> row_starts(graph.row_starts);
    const GuardedBuffer<uint16_t> columns(graph.columns);
    const auto floats = [&](size_t count, float size) {
      return std::make_unique<Floats>(random.Floats(count, -size, size), Place::kAligned64);
    };
    const auto input_gates = floats(3 * F * F, 20), gate_bias = floats(3 * F, 8), hidden_gates = floats(2 * F * F, 20),
               candidate = floats(F * F, 20), output = floats(F * F, 1), row = floats(F, 1),
               x = floats(kVertices * F, 1);
    const auto state = floats(GsgruStateFloats(kVertices, F), 1), next_x = floats(kVertices * F, 1);
    Floats scratch(GsgruScratchFloats(F), Place::kAligned64);
    const GsgruJob job = {x->data(),
                          row_starts.data(),
                          columns.data(),
                          input_gates->data(),
                          gate_bias->data(),
                          hidden_gates->data(),
                          candidate->data(),
                          output->data(),
                          row->data(),
                          row->data(),
                          row->data(),
                          nullptr,
                          state->data(),
                          next_x->data(),
                          nullptr,
                          scratch.data(),
                          kVertices,
                          F,
                          F,
                          0.25f,
                          0.125f};
    float largest = 0;
    for (int tick = 0; tick < 300; ++tick) {
      table().gsgru(job);
      for (size_t i = 0; i < kVertices * F; ++i) largest = std::max(largest, std::fabs((*state)[i]));
    }
    EXPECT_LE(largest, 1.0f) << table().name << " F " << F;
    EXPECT_GE(largest, 0.999f) << "nothing was saturated";
  }
}

// Rows of o far from zero, exact as all sums of the layer norm are: only differences from the mean may be squared.
TEST_P(GsgruTest, NormOfRowsFarFromZero) {
  for (const size_t F : {8, 16, 32, 64}) {
    const GuardedBuffer<uint32_t> row_starts(std::vector<uint32_t>{0, 1});
    const GuardedBuffer<uint16_t> columns(std::vector<uint16_t>{0});
    const auto floats = [](size_t count, float value) {
      return std::make_unique<Floats>(std::vector<float>(count, value), Place::kAligned64);
    };
    const auto gates = floats(3 * F * F, 0), row = floats(F, 1), output_bias = floats(F, 0), offset = floats(F, 0);
    double variance = 0;
    const auto apart = [F](size_t f) { return (F - 1 - 2 * static_cast<float>(f)) / 32; };
    for (size_t f = 0; f < F; ++f) {
      (*output_bias)[f] = 4096 + apart(f);
      variance += double{apart(f)} * apart(f) / static_cast<double>(F);
    }
    const auto x = floats(F, 1), state = floats(GsgruStateFloats(1, F), 0), next_x = floats(F, 0);
    Floats scratch(GsgruScratchFloats(F), Place::kAligned64);
    table().gsgru({x->data(),
                   row_starts.data(),
                   columns.data(),
                   gates->data(),
                   gates->data(),
                   gates->data(),
                   gates->data(),
                   gates->data(),
                   output_bias->data(),
                   row->data(),
                   offset->data(),
                   nullptr,
                   state->data(),
                   next_x->data(),
                   nullptr,
                   scratch.data(),
                   1,
                   F,
                   F,
                   1.0f,
                   0.0f});
    for (size_t f = 0; f < F; ++f) {
      const double exact = apart(f) / std::sqrt(variance + double{kGsgruEpsilon});
      ASSERT_NEAR((*next_x)[f], exact, Gamma(static_cast<double>(F) + 10) * std::fabs(exact))
          << table().name << " F " << F;
    }
  }
}

TEST_P(GsgruTest, LargeGraph) { Check(1021, 32, 32, false); }

}  // namespace
}  // namespace dcloth::kernels
