// Models without the last stages of their bundle.
#include "converter/stages.h"

#include <gtest/gtest.h>

#include <vector>

#include "converter/convert.h"
#include "converter/error.h"
#include "converter/rollout.h"
#include "dcloth/dcloth.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;
using dcloth::testing::ParseBundle;
using dcloth::testing::ParseSequence;

constexpr uint32_t kStages[] = {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH};

Bundle Holding(uint32_t stages) {
  const BundleSpec spec{.skeleton = stages != DCLOTH_STAGES_STATIC, .mesh = stages == DCLOTH_STAGES_MESH};
  return ParseBundle(spec);
}

ConvertOptions Keeping(uint32_t stages) { return {.rank = {.mode = RankMode::kFull}, .stages = stages}; }

std::vector<float> Played(const OpenModel& model, uint32_t stages) {
  std::vector<float> all;
  Rollout(model, ParseSequence({}, 20), stages, [&](size_t, std::span<const float> positions, std::span<const float>) {
    all.insert(all.end(), positions.begin(), positions.end());
  });
  return all;
}

TEST(StagesTest, KeepsWhatTheBundleHoldsAndNoMore) {
  for (const uint32_t held : kStages) {
    const Bundle bundle = Holding(held);
    EXPECT_EQ(StagesOf(bundle), held);
    EXPECT_EQ(ParseStages(StagesName(held)), held);
    for (const uint32_t asked : kStages) {
      if (asked <= held) {
        EXPECT_EQ(StagesOf(KeepStages(bundle, asked)), asked);
      } else {
        EXPECT_TRUE(Mentions(ErrorText([&] { KeepStages(bundle, asked); }), "b.safetensors", StagesName(asked),
                             std::string("at most '") + StagesName(held) + "'", "--stages"));
      }
    }
  }
}

// To the bit what the whole model draws when its ticks stop there.
TEST(StagesTest, DrawsWhatTheWholeModelDrawsUpToThere) {
  const Bundle bundle = ParseBundle({});
  const ConvertResult whole = Convert(bundle, Keeping(DCLOTH_STAGES_MESH));
  const OpenModel all(whole.bytes);
  uint64_t more = whole.report.model_bytes;
  uint32_t joints = whole.report.joint_count;
  for (const uint32_t stages : {DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_STATIC}) {
    const ConvertResult result = Convert(bundle, Keeping(stages));
    const OpenModel model(result.bytes);
    EXPECT_EQ(model.info().stages, stages);
    EXPECT_EQ(result.report.stages, stages);
    EXPECT_EQ(Played(model, stages), Played(all, stages));
    EXPECT_NE(Played(model, stages), Played(all, DCLOTH_STAGES_MESH));
    EXPECT_LT(result.report.model_bytes, more);
    EXPECT_LE(result.report.joint_count, joints);
    more = result.report.model_bytes;
    joints = result.report.joint_count;
  }
}

// What is left out counts as error.
TEST(StagesTest, ErrorsAreAgainstAllStages) {
  const Bundle bundle = ParseBundle({});
  const std::vector<Sequence> motion = {ParseSequence({}, 20)};
  const OpenModel all(Convert(bundle, {}).bytes);
  ConvertOptions options = Keeping(DCLOTH_STAGES_SKELETON);
  options.motion = motion;
  const ConvertResult result = Convert(bundle, options);
  const double missing_mm = result.report.trials.at(0).error.position_mm.max;
  EXPECT_GT(missing_mm, 1) << "the mesh stage of this garment does too little to tell";
  EXPECT_EQ(missing_mm, CompareModels(OpenModel(result.bytes), all, motion).position_mm.max);
  options.max_error_mm = missing_mm;
  EXPECT_EQ(Convert(bundle, options).report.stages, uint32_t{DCLOTH_STAGES_SKELETON});
  options.max_error_mm = 0.99 * missing_mm;
  EXPECT_THROW(Convert(bundle, options), ThresholdError);
  EXPECT_TRUE(Mentions(ErrorText([&] { Convert(bundle, options); }), "fp32", "keep all stages"));
  options.precision.reset();
  EXPECT_THROW(Convert(bundle, options), ThresholdError) << "no format makes up for a stage";
}

}  // namespace
}  // namespace dcloth::converter
