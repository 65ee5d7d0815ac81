// Formats and bones that the converter chooses itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "converter/assemble.h"
#include "converter/convert.h"
#include "converter/error.h"
#include "converter/rollout.h"
#include "converter/write_model.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;
using dcloth::testing::ParseBundle;
using dcloth::testing::ParseSequence;

TEST(ConvertAutoTest, AutoTakesTheCheapestThatHolds) {
  const Bundle bundle = ParseBundle({});
  const std::vector<Sequence> motion = {ParseSequence({}, 30)};
  ConvertOptions options{.motion = motion};
  double worst[3] = {};
  for (int i = 0; i < 3; ++i) {
    options.precision = kPrecisions[i];
    worst[i] = Convert(bundle, options).report.trials.at(0).error.position_mm.max;
  }
  EXPECT_EQ(worst[0], 0);
  ASSERT_GT(worst[2], worst[1]);
  ASSERT_GT(worst[1], 0);
  options.precision.reset();
  options.max_error_mm = worst[2];  // met exactly: one model is measured, again as the answer, and with a bone fewer
  const ConvertReport int8 = Convert(bundle, options).report;
  EXPECT_EQ(int8.precision, "int8");
  EXPECT_EQ(int8.trials.size(), 3u);
  options.max_error_mm = 0;
  const ConvertReport fp32 = Convert(bundle, options).report;
  EXPECT_EQ(fp32.precision, "fp32");
  // Below int8's error some tensor must give way, and not all of them do.
  options.max_error_mm = std::nextafter(worst[2], 0);
  const ConvertResult mixed = Convert(bundle, options);
  EXPECT_EQ(mixed.report.precision, "mixed");
  EXPECT_STREQ(OpenModel(mixed.bytes).info().precision, "mixed");
  EXPECT_GT(mixed.report.model_bytes, int8.model_bytes);
  EXPECT_LT(mixed.report.model_bytes, fp32.model_bytes);
  EXPECT_LE(mixed.report.trials.back().error.position_mm.max, *options.max_error_mm);
  options.precision = Precision::kInt8;
  options.max_error_mm = std::nextafter(worst[2], 0);
  bool threshold = false;
  try {
    Convert(bundle, options);
  } catch (const ThresholdError& error) {
    threshold = true;
    EXPECT_TRUE(Mentions(error.what(), "int8", "--precision auto"));
  }
  EXPECT_TRUE(threshold);
}

// What it says of its choice, against models made by hand.
TEST(ConvertAutoTest, AutoSaysWhy) {
  const Bundle bundle = ParseBundle({});
  const std::vector<Sequence> calibration = {ParseSequence({}, 30)}, motion = {ParseSequence({}, 12)};
  ConvertOptions options{.precision = Precision::kInt8, .rank = {.mode = RankMode::kFull}, .calibration = calibration};
  const double int8_mm = Convert(bundle, options).report.trials.at(0).calibration.position_mm.max;
  options.precision.reset();
  options.motion = motion;
  options.max_error_mm = 0.4 * int8_mm;
  const ConvertReport report = Convert(bundle, options).report;
  ASSERT_TRUE(report.automatic);
  const AutoReport& chosen = *report.automatic;
  EXPECT_TRUE(chosen.calibrated && chosen.checked);
  EXPECT_EQ(chosen.bound_mm, *options.max_error_mm);
  EXPECT_LE(chosen.error_mm, chosen.bound_mm);
  EXPECT_EQ(chosen.measured_models, report.trials.size());
  EXPECT_EQ(report.trials.back().calibration.position_mm.max, chosen.error_mm);
  EXPECT_EQ(report.trials.back().error.frame_count, 12u) << "checked on what the choice did not see";
  const FoldedBundle folded = FoldBundle(bundle, options.influences, options.body_influences);
  const OpenModel reference(WriteModel(Assemble(bundle, folded, {})));
  PrecisionPlan plan;
  for (const FormatDecision& d : chosen.decisions) plan.formats[d.tensor] = d.format;
  size_t raised = 0;
  for (const FormatDecision& d : chosen.decisions) {
    const auto stored = std::find_if(report.tensors.begin(), report.tensors.end(),
                                     [&](const TensorReport& t) { return t.name == d.tensor; });
    ASSERT_NE(stored, report.tensors.end()) << d.tensor;
    EXPECT_EQ(stored->dtype, d.format == Precision::kInt8 ? "i8" : d.format == Precision::kFp16 ? "f16" : "f32");
    if (!d.cheaper) continue;
    ++raised;
    PrecisionPlan lower = plan;
    lower.formats[d.tensor] = *d.cheaper;
    const OpenModel model(WriteModel(Assemble(bundle, folded, lower)));
    EXPECT_EQ(CompareModels(model, reference, calibration).position_mm.max, d.cheaper_mm) << d.tensor;
    EXPECT_GT(d.cheaper_mm, chosen.bound_mm);
  }
  EXPECT_GT(raised, 0u);
  EXPECT_LT(raised, chosen.decisions.size());
}

// Chosen while standing still, where int8 costs little, and checked while walking.
TEST(ConvertAutoTest, AutoIsCheckedOnUnseenMotion) {
  const Bundle bundle = ParseBundle({});
  const std::vector<Sequence> calibration = {ParseSequence({}, 1)}, motion = {ParseSequence({}, 40)};
  ConvertOptions options{.precision = Precision::kInt8, .motion = motion, .calibration = calibration};
  const Trial trial = Convert(bundle, options).report.trials.at(0);
  ASSERT_LT(trial.calibration.position_mm.max, 0.9 * trial.error.position_mm.max);
  options.precision.reset();
  options.max_error_mm = 1.05 * trial.calibration.position_mm.max;
  EXPECT_TRUE(Mentions(ErrorText([&] { Convert(bundle, options); }), "int8", "not calibrated on", "at most"));
}

// After formats, bones: as few as the bound allows, and what one fewer would cost.
TEST(ConvertAutoTest, AutoPrunesInfluencesWithinTheBound) {
  const Bundle bundle = ParseBundle({});
  const std::vector<Sequence> calibration = {ParseSequence({}, 30)}, motion = {ParseSequence({}, 12)};
  ConvertOptions options{.motion = motion, .rank = {.mode = RankMode::kFull}, .calibration = calibration};
  options.precision.reset();
  const auto converted = [&](double bound) {
    options.max_error_mm = bound;
    return Convert(bundle, options);
  };
  const uint32_t all = converted(0).report.automatic->influences;
  ASSERT_GT(all, 2u);
  std::vector<uint32_t> kept;
  for (const double bound : {10.0, 100.0, 1e5}) {
    const ConvertResult result = converted(bound);
    const ConvertReport& report = result.report;
    const AutoReport& chosen = *report.automatic;
    kept.push_back(chosen.influences);
    EXPECT_EQ(report.influences.influences, chosen.influences);
    EXPECT_EQ(report.trials.back().influences, chosen.influences);
    EXPECT_LE(report.trials.back().error.position_mm.max, bound);
    EXPECT_LE(report.trials.back().calibration.position_mm.max, bound);
    EXPECT_EQ(report.trials.back().error.frame_count, 12u);
    EXPECT_EQ(report.trials.back().model_bytes, result.bytes.size());
    EXPECT_EQ(chosen.fewer_influences_mm.has_value(), chosen.influences > 1);
    if (!chosen.fewer_influences_mm) continue;
    EXPECT_GT(*chosen.fewer_influences_mm, bound);
    // By hand: the same formats with one bone fewer.
    PrecisionPlan plan;
    for (const FormatDecision& d : chosen.decisions) plan.formats[d.tensor] = d.format;
    const FoldedBundle whole = FoldBundle(bundle, 8, 8), fewer = FoldBundle(bundle, chosen.influences - 1, 8);
    const OpenModel reference(WriteModel(Assemble(bundle, whole, {})));
    const OpenModel model(WriteModel(Assemble(bundle, fewer, plan)));
    EXPECT_EQ(CompareModels(model, reference, calibration).position_mm.max, *chosen.fewer_influences_mm);
  }
  EXPECT_GE(kept[0], kept[1]);
  EXPECT_GT(kept[1], kept[2]) << "the bounds are all too tight to show anything";
  EXPECT_EQ(kept[2], 1u);
}

}  // namespace
}  // namespace dcloth::converter
