#include "converter/rollout.h"

#include <gtest/gtest.h>

#include "converter/convert.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BuildBundle;
using dcloth::testing::BuildSequence;
using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;

AlignedBytes Model(const BundleSpec& spec) {
  return Convert(BundleFrom(SafeFile::Parse(BuildBundle(spec).Bytes(), "b")), {}).bytes;
}
Sequence Motion(const BundleSpec& spec, uint32_t frames, double fps = 30) {
  return SequenceFrom(SafeFile::Parse(BuildSequence(spec, frames, false, fps).Bytes(), "s.safetensors"));
}

TEST(RolloutTest, VisitsEveryFrameAndForgetsBetweenRuns) {
  BundleSpec spec;
  const OpenModel model(Model(spec));
  const Sequence sequence = Motion(spec, 9);
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
  EXPECT_TRUE(Mentions(ErrorText([&] { Rollout(model, Motion(spec, 2, 60), 1, ignore); }), "resample the sequence"));
  EXPECT_EQ(ErrorText([&] { Rollout(model, Motion(spec, 2, 29.97), 1, ignore); }), "");
  BundleSpec other;
  other.joints = 4;
  EXPECT_TRUE(Mentions(ErrorText([&] { Rollout(model, Motion(other, 2), 1, ignore); }), "no joints joint_4, joint_5"));
  EXPECT_TRUE(Mentions(ErrorText([&] { Rollout(model, Motion(spec, 2), 2, ignore); }), "the tick of frame 0 refused"));
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
  const std::vector<Sequence> motion = {Motion(spec, 5), Motion(spec, 4)};
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
