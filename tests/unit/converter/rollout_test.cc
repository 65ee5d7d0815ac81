#include "converter/rollout.h"

#include <gtest/gtest.h>

#include "converter/convert.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;
using dcloth::testing::ParseBundle;
using dcloth::testing::ParseSequence;

AlignedBytes Model(const BundleSpec& spec) { return Convert(ParseBundle(spec), {}).bytes; }

TEST(RolloutTest, VisitsEveryFrameAndForgetsBetweenRuns) {
  BundleSpec spec;
  const OpenModel model(Model(spec));
  const Sequence sequence = ParseSequence(spec, 9);
  std::vector<std::vector<float>> runs(2);
  for (std::vector<float>& run : runs) {
    size_t next = 0;
    Rollout(model, sequence, DCLOTH_STAGES_MESH,
            [&](size_t frame, std::span<const float> positions, std::span<const float> normals) {
              EXPECT_EQ(frame, next++);
              EXPECT_EQ(positions.size(), 3 * spec.vertices);
              EXPECT_EQ(normals.size(), 3 * spec.vertices);
              run.insert(run.end(), positions.begin(), positions.end());
            });
    EXPECT_EQ(next, 9u);
  }
  EXPECT_EQ(runs[0], runs[1]);
}

TEST(RolloutTest, OtherRatesAndCharactersAreRefused) {
  BundleSpec spec;
  const OpenModel model(Model(spec));
  const auto ignore = [](size_t, std::span<const float>, std::span<const float>) {};
  EXPECT_TRUE(
      Mentions(ErrorText([&] { Rollout(model, ParseSequence(spec, 2, 60), 1, ignore); }), "resample the sequence"));
  EXPECT_EQ(ErrorText([&] { Rollout(model, ParseSequence(spec, 2, 29.97), 1, ignore); }), "");
  BundleSpec other;
  other.joints = 4;
  EXPECT_TRUE(
      Mentions(ErrorText([&] { Rollout(model, ParseSequence(other, 2), 1, ignore); }), "no joints joint_4, joint_5"));
  EXPECT_TRUE(
      Mentions(ErrorText([&] { Rollout(model, ParseSequence(spec, 2), 2, ignore); }), "the tick of frame 0 refused"));
}

TEST(RolloutTest, BadBytesCarryTheEnginesWords) {
  AlignedBytes bytes = Model({});
  bytes.resize(bytes.size() - 64);
  const std::string text = ErrorText([&] { OpenModel(std::move(bytes), "m.dcloth"); });
  EXPECT_TRUE(Mentions(text, "m.dcloth: found "));
  EXPECT_GT(text.size(), 30u);
}

TEST(RolloutTest, AModelDiffersFromItselfByNothing) {
  BundleSpec spec;
  const OpenModel a(Model(spec)), b(Model(spec));
  const std::vector<Sequence> motion = {ParseSequence(spec, 5), ParseSequence(spec, 4)};
  const MeshError same = CompareModels(a, b, motion);
  EXPECT_EQ(same.frame_count, 9u);
  EXPECT_EQ(same.position_mm.max, 0);
  BundleSpec other = spec;
  other.seed = 5;
  EXPECT_GT(CompareModels(OpenModel(Model(other)), a, motion).position_mm.mean, 1);
  other.vertices = 61;
  EXPECT_TRUE(
      Mentions(ErrorText([&] { CompareModels(OpenModel(Model(other)), a, motion); }), "61 vertices in the prediction"));
}

}  // namespace
}  // namespace dcloth::converter
