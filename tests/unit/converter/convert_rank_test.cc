// Models with a reduced basis, from the bundle to the engine's vertices.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>

#include "converter/convert.h"
#include "converter/error.h"
#include "converter/model_maker.h"
#include "converter/rollout.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

ConvertOptions With(Precision precision, RankMode mode = RankMode::kExact, uint32_t rank = 0) {
  return {.precision = precision, .rank = {mode, rank}};
}

// A garment large enough that int8 saves with the head.
BundleSpec Spec() { return {.vertices = 300, .skeleton_basis = 21, .mesh_basis = 11}; }

TEST(ConvertRankTest, KnownRankIsFoundAndCostsNothing) {
  const BundleSpec spec = Spec();
  Bundle bundle = ParseBundle(spec);
  LowerRank(&bundle, 9);
  const std::vector<Sequence> motion = {ParseSequence(spec, 30)};
  for (const Precision precision : kPrecisions) {
    ConvertOptions exact = With(precision), full = With(precision, RankMode::kFull);
    exact.motion = full.motion = motion;
    const ConvertResult reduced = Convert(bundle, exact), kept = Convert(bundle, full);
    EXPECT_TRUE(reduced.report.rank.reduced);
    EXPECT_FALSE(kept.report.rank.reduced);
    EXPECT_EQ(reduced.report.rank.full, 32u);
    EXPECT_EQ(reduced.report.rank.exact, 10u);  // 9, stored in pairs
    const uint32_t rows = reduced.report.rank.rank;
    EXPECT_TRUE(precision == Precision::kInt8 ? rows >= 10 && rows < 32 : rows == 10) << rows;  // int8: remainders
    EXPECT_EQ(kept.report.rank.rank, 32u);
    EXPECT_LT(reduced.report.model_bytes, kept.report.model_bytes);
    ASSERT_EQ(reduced.report.trials.size(), 1u);
    EXPECT_EQ(reduced.report.trials[0].rank, rows);
    const double after = reduced.report.trials[0].error.position_mm.max;
    const double before = kept.report.trials[0].error.position_mm.max;
    if (precision == Precision::kFp32) {
      EXPECT_EQ(before, 0);
      // The displacement is a sum of 32 products, P below 1 and Q below 3 here; the rank may leave sqrt(32) 2^-24 of
      // each row's length and float arithmetic as much again. A row's length is below sqrt(900 / 3) * 0.05 m.
      const double millimetres = 1e3 * 2 * std::sqrt(32) * 0x1p-24 * (21 * 1 + 11 * 3) * std::sqrt(300) * 0.05;
      EXPECT_LE(after, millimetres);
      EXPECT_GT(after, 0) << "the same model was compared with itself";
    } else {
      // Fewer rows, each the sum of many: what int8 and fp16 lose does not grow.
      EXPECT_LE(after, 1.5 * before) << PrecisionName(precision);
    }
  }
}

// Levels of detail below the mesh stage use the same rows.
TEST(ConvertRankTest, EveryLevelAgreesWithTheFullBasis) {
  const BundleSpec spec = Spec();
  Bundle bundle = ParseBundle(spec);
  LowerRank(&bundle, 9);
  const Sequence motion = ParseSequence(spec, 20);
  const OpenModel reduced(Convert(bundle, With(Precision::kFp32)).bytes);
  const OpenModel full(Convert(bundle, With(Precision::kFp32, RankMode::kFull)).bytes);
  std::vector<std::vector<float>> levels;
  for (const uint32_t stages : {DCLOTH_STAGES_STATIC, DCLOTH_STAGES_SKELETON, DCLOTH_STAGES_MESH}) {
    const std::vector<float> expected = Played(full, motion, stages), found = Played(reduced, motion, stages);
    double worst = 0;
    for (size_t i = 0; i < expected.size(); ++i)
      worst = std::max(worst, std::abs(static_cast<double>(expected[i] - found[i])));
    EXPECT_LT(worst, 2e-6) << stages;  // two roundings of a float of up to 4 m, and the displacement's own, far below
    if (!levels.empty()) {
      double apart = 0;
      for (size_t i = 0; i < expected.size(); ++i)
        apart = std::max(apart, std::abs(static_cast<double>(expected[i] - levels.back()[i])));
      EXPECT_GT(apart, 1e-3) << "levels differ by millimetres";
    }
    levels.push_back(expected);
  }
}

TEST(ConvertRankTest, BundlesOfFullRankStayAsTheyAre) {
  const Bundle bundle = ParseBundle(Spec());
  const ConvertResult exact = Convert(bundle, With(Precision::kInt8));
  const ConvertResult full = Convert(bundle, With(Precision::kInt8, RankMode::kFull));
  EXPECT_FALSE(exact.report.rank.reduced);
  ASSERT_EQ(exact.bytes.size(), full.bytes.size());
  EXPECT_EQ(std::memcmp(exact.bytes.data(), full.bytes.data(), full.bytes.size()), 0);
  const BundleSpec still{.skeleton = false, .mesh = false};
  EXPECT_EQ(Convert(ParseBundle(still), With(Precision::kFp32)).report.rank.full, 0u);
}

// The search's answer against every rank tried by hand.
TEST(ConvertRankTest, SearchFindsTheSmallestRankWithinTheBound) {
  const BundleSpec spec = Spec();
  const Bundle bundle = ParseBundle(spec);
  const std::vector<Sequence> calibration = {ParseSequence(spec, 25)};
  for (const Precision precision : kPrecisions) {
    std::vector<double> errors;  // of ranks 2, 4, ...
    for (uint32_t rank = 2; rank <= 32; rank += 2) {
      ConvertOptions options = With(precision, RankMode::kFixed, rank);
      options.calibration = calibration;
      const ConvertReport report = Convert(bundle, options).report;
      EXPECT_EQ(report.rank.rank, rank);
      errors.push_back(report.trials.at(0).calibration.position_mm.max);
    }
    EXPECT_LT(errors[15], 0.05 * errors[0]);
    for (const size_t wanted : {size_t{1}, size_t{5}, size_t{9}}) {
      ConvertOptions options = With(precision, RankMode::kSearch);
      options.calibration = calibration;
      options.max_error_mm = errors[wanted];
      const ConvertReport report = Convert(bundle, options).report;
      const size_t found = report.rank.rank / 2 - 1;
      EXPECT_LE(errors[found], *options.max_error_mm);
      ASSERT_GT(found, 0u);
      EXPECT_GT(errors[found - 1], *options.max_error_mm) << "rank " << report.rank.rank;
      EXPECT_LE(found, wanted);
      EXPECT_EQ(report.trials.back().calibration.frame_count, 25u);
    }
  }
}

// A bound too tight for the exact rank leaves the basis whole; one too tight for the precision is refused.
TEST(ConvertRankTest, BoundsBelowTheRoundingKeepTheFullBasis) {
  const BundleSpec spec = Spec();
  Bundle bundle = ParseBundle(spec);
  LowerRank(&bundle, 9, true);
  const std::vector<Sequence> motion = {ParseSequence(spec, 10)};
  ConvertOptions options = With(Precision::kFp32);
  options.motion = motion;
  options.max_error_mm = 1e-9;
  ConvertReport report = Convert(bundle, options).report;
  EXPECT_FALSE(report.rank.reduced);
  EXPECT_EQ(report.trials.size(), 2u);
  options.rank.mode = RankMode::kSearch;
  options.calibration = motion;
  report = Convert(bundle, options).report;
  EXPECT_FALSE(report.rank.reduced);
  options.precision = Precision::kInt8;
  EXPECT_THROW(Convert(bundle, options), ThresholdError);
}

// Calibrated while standing still, tested while walking: the search is right about the one and the check about the
// other.
TEST(ConvertRankTest, UnseenMotionHasTheLastWord) {
  const BundleSpec spec = Spec();
  const Bundle bundle = ParseBundle(spec);
  const std::vector<Sequence> calibration = {ParseSequence(spec, 2)}, motion = {ParseSequence(spec, 60)};
  ConvertOptions options = With(Precision::kFp32, RankMode::kSearch);
  options.calibration = calibration;
  options.max_error_mm = 0.5;
  const ConvertReport alone = Convert(bundle, options).report;
  ASSERT_LT(alone.rank.rank, alone.rank.exact);
  options.motion = motion;
  bool threshold = false;
  try {
    Convert(bundle, options);
  } catch (const ThresholdError& error) {
    threshold = true;
    EXPECT_TRUE(Mentions(error.what(), "rank " + std::to_string(alone.rank.rank), "not calibrated on",
                         "; calibrate on motion of that kind too, or pass --rank exact"));
  }
  EXPECT_TRUE(threshold);
  // Measured, not steered by: without a bound the same rank passes, and both figures are told.
  ConvertOptions fixed = With(Precision::kFp32, RankMode::kFixed, alone.rank.rank);
  fixed.calibration = calibration;
  fixed.motion = motion;
  const Trial trial = Convert(bundle, fixed).report.trials.at(0);
  EXPECT_LE(trial.calibration.position_mm.max, 0.5);
  EXPECT_GT(trial.error.position_mm.max, 0.5);
  EXPECT_EQ(trial.error.frame_count, 60u);
}

TEST(ConvertRankTest, AutoPrecisionThenSearchesForRows) {
  const BundleSpec spec = Spec();
  const Bundle bundle = ParseBundle(spec);
  const std::vector<Sequence> calibration = {ParseSequence(spec, 20)};
  ConvertOptions options = With(Precision::kInt8, RankMode::kFull);
  options.calibration = calibration;
  const double int8_mm = Convert(bundle, options).report.trials.at(0).error.position_mm.max;
  options.precision.reset();
  options.rank.mode = RankMode::kSearch;
  const OpenModel reference(Convert(bundle, With(Precision::kFp32, RankMode::kFull)).bytes);
  for (const bool loose : {false, true}) {
    options.max_error_mm = (loose ? 30 : 0.2) * int8_mm;
    const ConvertResult found = Convert(bundle, options);
    const RankReport& rank = found.report.rank;
    EXPECT_EQ(found.report.precision, loose ? "int8" : "mixed");
    EXPECT_EQ(found.report.automatic->rank, rank.exact);
    EXPECT_TRUE(loose ? rank.rank < rank.exact : rank.rank <= rank.exact) << rank.rank;
    EXPECT_LE(CompareModels(OpenModel(found.bytes), reference, calibration).position_mm.max, *options.max_error_mm);
  }
}

TEST(ConvertRankTest, BadRequestsAreRefused) {
  const BundleSpec spec = Spec();
  Bundle bundle = ParseBundle(spec);
  LowerRank(&bundle, 9);
  const auto refusal = [&](const Bundle& from, const ConvertOptions& options) {
    return ErrorText([&] { Convert(from, options); });
  };
  EXPECT_TRUE(Mentions(refusal(bundle, With(Precision::kFp32, RankMode::kFixed, 8)), "a rank of 8", "own rank of 10",
                       "--calibrate"));
  EXPECT_EQ(refusal(bundle, With(Precision::kFp32, RankMode::kFixed, 9)), "");
  const std::vector<Sequence> motion = {ParseSequence(spec, 1)};
  ConvertOptions least = With(Precision::kFp32, RankMode::kFixed, 1);
  least.calibration = motion;
  EXPECT_EQ(Convert(bundle, least).report.rank.rank, 2u);
  EXPECT_EQ(Convert(bundle, With(Precision::kFp32, RankMode::kFixed, 1000)).report.rank.rank, 10u);
  EXPECT_TRUE(Mentions(refusal(bundle, With(Precision::kFp32, RankMode::kFixed, 0)), "rank 0"));
  EXPECT_TRUE(Mentions(refusal(bundle, With(Precision::kFp32, RankMode::kSearch)), "--max-error-mm", "--calibrate"));
  ConvertOptions half = With(Precision::kFp32, RankMode::kSearch);
  half.calibration = motion;
  EXPECT_TRUE(Mentions(refusal(bundle, half), "a search for the rank without an error bound"));
  half.calibration = {};
  half.motion = motion;
  half.max_error_mm = 1;
  EXPECT_TRUE(Mentions(refusal(bundle, half), "a search for the rank without an error bound"));
  BundleSpec still = spec;
  still.skeleton = still.mesh = false;
  EXPECT_TRUE(Mentions(refusal(ParseBundle(still), With(Precision::kFp32, RankMode::kFixed, 4)), "no skeleton stage"));
}

// What measures models of many ranks makes those that a conversion writes.
TEST(ConvertRankTest, ModelMakerMakesTheSameModels) {
  Bundle bundle = ParseBundle(Spec());
  LowerRank(&bundle, 6);
  ModelMaker maker(bundle, {});
  for (const RankMode mode : {RankMode::kFull, RankMode::kExact}) {
    const ConvertOptions options{.precision = Precision::kFp16, .rank = {.mode = mode}};
    const uint32_t rank = mode == RankMode::kFull ? RankMaker::kFullRank : maker.DefaultRank(Precision::kFp16);
    const MadeModel made = maker.Make(Precision::kFp16, rank);
    EXPECT_TRUE(std::ranges::equal(made.model.bytes(), Convert(bundle, options).bytes));
  }
}

}  // namespace
}  // namespace dcloth::converter
