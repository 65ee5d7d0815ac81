// What a conversion tried and chose itself, what it says of it, and what it says where the bound is missed.
#include "converter/attempts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "converter/assemble.h"
#include "converter/convert.h"
#include "converter/error.h"
#include "converter/rollout.h"
#include "converter/write_model.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

std::string Number(double value) {
  char text[32];
  std::snprintf(text, sizeof(text), "%.6g", value);
  return text;
}

// A still clip and one that walks: what holds on the first need not on the second.
class AttemptsTest : public ::testing::Test {
 protected:
  AttemptsTest() : bundle_(ParseBundle(spec_)), still_{ParseSequence(spec_, 1)}, walk_{ParseSequence(spec_, 60)} {}

  ConvertOptions Asked(std::optional<Precision> precision, RankMode mode, uint32_t rank = 0) const {
    return {.precision = precision, .rank = {mode, rank}};
  }
  Trial Measured(ConvertOptions options) const {
    options.max_error_mm.reset();
    return Convert(bundle_, options).report.trials.at(0);
  }
  std::string Refusal(ConvertOptions options, double bound) const {
    options.max_error_mm = bound;
    return ErrorText([&] { Convert(bundle_, options); });
  }

  BundleSpec spec_;
  Bundle bundle_;
  std::vector<Sequence> still_, walk_;
};

std::string Missed(const std::string& what, double error_mm, const std::string& where, double bound,
                   const std::string& mend) {
  return "b.safetensors: found " + what + " to differ from fp32 by up to " + Number(error_mm) + " mm" + where +
         ", expected at most " + Number(bound) + " mm; raise --max-error-mm" + mend;
}

TEST_F(AttemptsTest, AMissedBoundSaysByHowMuchWhereAndWhatToDo) {
  const std::string kAuto = ", or pass --precision auto", kUnseen = " on motion that it was not calibrated on";
  for (const bool fixed : {false, true}) {
    const std::string what = fixed ? "int8 of rank 8" : "int8", rank = fixed ? " or --rank" : "";
    const ConvertOptions asked = Asked(Precision::kInt8, fixed ? RankMode::kFixed : RankMode::kFull, 8);
    ConvertOptions options = asked;
    options.calibration = walk_;
    const double worst = Measured(options).calibration.position_mm.max;
    EXPECT_EQ(Refusal(options, worst), "");
    EXPECT_EQ(Refusal(options, worst / 2), Missed(what, worst, "", worst / 2, rank + kAuto));
    // Both miss: what it was calibrated on comes first.
    const std::vector<Sequence> run = {ParseSequence(spec_, 240)};
    options.motion = run;
    const double other = Measured(options).error.position_mm.max;
    ASSERT_NE(Number(other), Number(worst));
    const double both = std::min(worst, other) / 2;
    EXPECT_EQ(Refusal(options, both), Missed(what, worst, "", both, rank + kAuto));
    options.calibration = still_;
    options.motion = walk_;
    const Trial trial = Measured(options);
    const double low = trial.calibration.position_mm.max, high = trial.error.position_mm.max;
    ASSERT_LT(low, 0.9 * high);
    EXPECT_EQ(Refusal(options, low),
              Missed(what, high, kUnseen, low, ", or calibrate on motion of that kind too" + kAuto));
    EXPECT_EQ(Refusal(options, low / 2), Missed(what, low, "", low / 2, rank + kAuto));
    EXPECT_EQ(Refusal(options, high), "");
  }
  ConvertOptions options = Asked(Precision::kInt8, RankMode::kFull);
  options.motion = walk_;
  const double worst = Measured(options).error.position_mm.max;
  EXPECT_EQ(Refusal(options, worst / 2), Missed("int8", worst, "", worst / 2, kAuto));
}

// No format is left to raise: of two rows float32 misses the bound too.
TEST_F(AttemptsTest, FormatsOfARankThatMissesAreRefused) {
  ConvertOptions options = Asked(Precision::kFp32, RankMode::kFixed, 2);
  options.calibration = walk_;
  const double worst = Measured(options).calibration.position_mm.max;
  ASSERT_GT(worst, 1e-3);
  options.precision.reset();
  EXPECT_EQ(Refusal(options, worst / 2), Missed("fp32 of rank 2", worst, "", worst / 2, " or --rank"));
}

// By hand: which rank the formats are chosen at, which the model has then, and how often the callback is told what.
TEST_F(AttemptsTest, FormatsAreChosenAtTheRankThatIsAskedFor) {
  LowerRank(&bundle_, 5);
  struct Case {
    RankMode mode;
    uint32_t asked, chosen_at, stored;
  };
  for (const Case& each :
       {Case{RankMode::kExact, 0, 6, 6}, Case{RankMode::kFull, 0, 17, 17}, Case{RankMode::kFixed, 3, 4, 4},
        Case{RankMode::kFixed, 9, 6, 6}, Case{RankMode::kSearch, 0, 6, 2}}) {
    for (const bool with_motion : {false, true}) {
      ConvertOptions options = Asked({}, each.mode, each.asked);
      options.calibration = walk_;
      if (with_motion) options.motion = still_;
      options.max_error_mm = 1e3;
      std::vector<std::pair<size_t, size_t>> told;
      options.choosing = [&](size_t done, size_t all) { told.push_back({done, all}); };
      const ConvertReport report = Convert(bundle_, options).report;
      const AutoReport& chosen = *report.automatic;
      EXPECT_EQ(chosen.bound_mm, 1e3);
      EXPECT_TRUE(chosen.calibrated);
      EXPECT_EQ(chosen.checked, with_motion);
      EXPECT_EQ(chosen.rank, each.chosen_at);
      EXPECT_EQ(report.rank.reduced, each.stored != 17);
      EXPECT_EQ(report.rank.rank, each.stored);
      EXPECT_EQ(chosen.measured_models, report.trials.size());
      EXPECT_EQ(report.trials.front().rank, each.chosen_at);
      EXPECT_EQ(told, (std::vector<std::pair<size_t, size_t>>{{1, 6 * chosen.decisions.size()}}));
    }
  }
  // Without calibration the choice looks at the motion, and no rank below the exact one is sought.
  ConvertOptions options = Asked({}, RankMode::kExact);
  options.motion = walk_;
  options.max_error_mm = 1e3;
  const ConvertReport report = Convert(bundle_, options).report;
  EXPECT_FALSE(report.automatic->calibrated || report.automatic->checked);
  EXPECT_EQ(report.automatic->rank, 6u);
  EXPECT_EQ(report.rank.rank, 6u);
}

TEST_F(AttemptsTest, ABasisOfFullRankIsKeptUnlessASearchIsAskedFor) {
  for (const RankMode mode : {RankMode::kExact, RankMode::kSearch}) {
    ConvertOptions options = Asked({}, mode);
    options.calibration = walk_;
    options.max_error_mm = 1e3;
    const ConvertReport report = Convert(bundle_, options).report;
    EXPECT_EQ(report.automatic->rank, mode == RankMode::kSearch ? 18u : 17u);
    EXPECT_EQ(report.rank.reduced, mode == RankMode::kSearch);
  }
}

// The exact rank rounds, and more than nothing is too much: formats are chosen again for the basis as it is.
TEST_F(AttemptsTest, WhereTheExactRankMissesTheFormatsAreThoseOfTheFullOne) {
  LowerRank(&bundle_, 5);
  for (const RankMode mode : {RankMode::kExact, RankMode::kSearch}) {
    ConvertOptions options = Asked({}, mode);
    options.calibration = walk_;
    options.max_error_mm = 0;
    const ConvertReport report = Convert(bundle_, options).report;
    EXPECT_EQ(report.precision, "fp32");
    EXPECT_FALSE(report.rank.reduced);
    EXPECT_EQ(report.automatic->rank, 17u);
    EXPECT_EQ(report.automatic->error_mm, 0);
    EXPECT_FALSE(report.automatic->decisions.empty());
    for (const FormatDecision& each : report.automatic->decisions) EXPECT_EQ(each.format, Precision::kFp32);
    EXPECT_EQ(report.trials.front().rank, 6u);
    EXPECT_EQ(report.trials.back().rank, 17u);
  }
}

// Each measured model is told, the estimate never below what is done.
TEST_F(AttemptsTest, ProgressCountsModels) {
  ConvertOptions options = Asked(Precision::kInt8, RankMode::kFull);
  options.motion = walk_;
  const double bound = 0.2 * Measured(options).error.position_mm.max;
  options.precision.reset();
  options.max_error_mm = bound;
  std::vector<std::pair<size_t, size_t>> told, expected;
  options.choosing = [&](size_t done, size_t all) { told.push_back({done, all}); };
  const ConvertReport report = Convert(bundle_, options).report;
  const size_t tensors = report.automatic->decisions.size();
  ASSERT_GT(tensors, 5u);
  ASSERT_GT(told.size(), tensors);
  for (size_t i = 1; i <= told.size(); ++i) expected.push_back({i, std::max(i, 6 * tensors)});
  EXPECT_EQ(told, expected);
  EXPECT_LT(told.size(), report.trials.size()) << "what was chosen is measured again";
}

// A search has nothing to search where there is no skeleton stage.
TEST_F(AttemptsTest, WithoutABasisASearchIsOneModel) {
  spec_.skeleton = spec_.mesh = false;
  bundle_ = ParseBundle(spec_);
  ConvertOptions options = Asked(Precision::kFp16, RankMode::kSearch);
  options.calibration = still_;
  options.motion = walk_;
  options.max_error_mm = 1e3;
  const ConvertReport report = Convert(bundle_, options).report;
  ASSERT_EQ(report.trials.size(), 1u);
  EXPECT_EQ(report.trials[0].error.frame_count, 60u);
  EXPECT_EQ(report.trials[0].rank, 0u);
  EXPECT_FALSE(report.rank.reduced);
  options.precision.reset();
  const ConvertReport chosen = Convert(bundle_, options).report;
  EXPECT_EQ(chosen.automatic->rank, 0u);
  EXPECT_FALSE(chosen.rank.reduced);
}

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
  EXPECT_THROW(Convert(bundle, options), ThresholdError);
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
