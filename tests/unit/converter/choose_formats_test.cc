// The choice of formats against every combination, with errors that are known.
#include "converter/choose_formats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <random>

namespace dcloth::converter {
namespace {

constexpr uint64_t Bytes(Precision format) {
  return format == Precision::kFp32 ? 4 : format == Precision::kFp16 ? 2 : 1;
}

// A model of tensors whose errors add as squares: int8 costs `int8_mm`, fp16 a hundredth of it.
struct Made {
  std::vector<FormatOption> options;
  std::vector<double> int8_mm;

  double Error(const std::vector<Precision>& formats) const {
    double sum = 0;
    for (size_t t = 0; t < formats.size(); ++t) {
      const double share = formats[t] == Precision::kInt8 ? 1 : formats[t] == Precision::kFp16 ? 0.01 : 0;
      sum += share * share * int8_mm[t] * int8_mm[t];
    }
    return std::sqrt(sum);
  }
  // As the assembler reads a plan.
  std::vector<Precision> Formats(const PrecisionPlan& plan) const {
    std::vector<Precision> formats;
    for (const FormatOption& option : options) {
      const auto named = plan.formats.find(option.tensor);
      const Precision format = named == plan.formats.end() ? plan.precision : named->second;
      formats.push_back(Bytes(format) < Bytes(option.lowest)                     ? option.lowest
                        : format == Precision::kFp16 && !option.has_halves ? Precision::kFp32
                                                                           : format);
    }
    return formats;
  }
  uint64_t Size(const std::vector<Precision>& formats) const {
    uint64_t bytes = 0;
    for (size_t t = 0; t < formats.size(); ++t) bytes += options[t].element_count * Bytes(formats[t]);
    return bytes;
  }
  std::optional<FormatPlan> Choose(double bound, size_t* count = nullptr) const {
    return ChooseFormats(options, bound, [&](const PrecisionPlan& plan) {
      if (count != nullptr) ++*count;
      return Error(Formats(plan));
    });
  }
};

Made FromSeed(unsigned seed) {
  std::mt19937 random(seed);
  Made made;
  const size_t count = 2 + random() % 5;
  for (size_t t = 0; t < count; ++t) {
    const Precision lowest = random() % 4 == 0 ? Precision::kFp16 : Precision::kInt8;
    const bool has_halves = lowest == Precision::kFp16 || random() % 4 != 0;
    made.options.push_back({std::to_string(t), lowest, 10 + random() % 1000, has_halves});
    made.int8_mm.push_back(std::exp(static_cast<double>(random() % 1000) / 150.0));
  }
  return made;
}

TEST(ChooseFormatsTest, TheCheapestThatKeepsTheBoundNeedsOneMeasurement) {
  const Made made = FromSeed(1);
  size_t count = 0;
  const FormatPlan plan = *made.Choose(1e9, &count);
  EXPECT_EQ(count, 1u);
  EXPECT_STREQ(plan.plan.name(), "int8");
  for (size_t t = 0; t < made.options.size(); ++t) {
    EXPECT_EQ(plan.decisions[t].format, made.options[t].lowest);
    EXPECT_FALSE(plan.decisions[t].cheaper);
  }
}

TEST(ChooseFormatsTest, TheOneThatCostsIsRaised) {
  const Made made{{{"large", Precision::kInt8, 1000}, {"loud", Precision::kInt8, 500}, {"still", Precision::kInt8, 9}},
                  {1, 40, 0.5}};
  const FormatPlan plan = *made.Choose(2);
  EXPECT_EQ(made.Formats(plan.plan), (std::vector<Precision>{Precision::kInt8, Precision::kFp16, Precision::kInt8}));
  EXPECT_STREQ(plan.plan.name(), "mixed");
  EXPECT_EQ(plan.decisions[1].cheaper, Precision::kInt8);
  EXPECT_DOUBLE_EQ(plan.decisions[1].cheaper_mm, std::sqrt(1 + 1600 + 0.25));
  EXPECT_DOUBLE_EQ(plan.error_mm, std::sqrt(1 + 0.16 + 0.25));
}

// Halves of either would keep the bound; the one with the larger error hardly gains by them.
TEST(ChooseFormatsTest, TheOneThatGainsIsRaisedNotTheOneThatCostsMost) {
  const Made made{{{"stubborn", Precision::kInt8, 100}, {"willing", Precision::kInt8, 100}}, {}};
  const FormatPlan plan = *ChooseFormats(made.options, 12.5, [&](const PrecisionPlan& measured) {
    const std::vector<Precision> formats = made.Formats(measured);
    const auto of = [&](size_t t, double int8, double fp16) {
      return formats[t] == Precision::kInt8 ? int8 : formats[t] == Precision::kFp16 ? fp16 : 0;
    };
    return std::hypot(of(0, 10, 9), of(1, 8, 0.1));
  });
  EXPECT_EQ(made.Formats(plan.plan), (std::vector<Precision>{Precision::kInt8, Precision::kFp16}));
}

TEST(ChooseFormatsTest, AUniformAnswerIsCalledSo) {
  const Made made{{{"a", Precision::kInt8, 10}, {"b", Precision::kFp16, 10}}, {5, 5}};
  EXPECT_STREQ(made.Choose(0.5)->plan.name(), "fp16");
  EXPECT_STREQ(made.Choose(0)->plan.name(), "fp32");
  EXPECT_STREQ(made.Choose(6)->plan.name(), "int8");
}

TEST(ChooseFormatsTest, ABoundThatFloatsMissHasNoAnswer) {
  const Made made = FromSeed(2);
  EXPECT_FALSE(ChooseFormats(made.options, 1, [](const PrecisionPlan&) { return 1.5; }));
}

TEST(ChooseFormatsTest, AnswersKeepTheBoundAndNoTensorCanBeCheaper) {
  size_t mixed = 0, best = 0, count = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Made made = FromSeed(seed);
    const double cheapest = made.Error(made.Formats({Precision::kInt8, {}}));
    for (const double share : {0.9, 0.3, 0.05, 0.002}) {
      const double bound = share * cheapest;
      size_t measured = 0;
      const FormatPlan plan = *made.Choose(bound, &measured);
      EXPECT_LE(measured, 7 * made.options.size() + 2);
      const std::vector<Precision> formats = made.Formats(plan.plan);
      EXPECT_LE(made.Error(formats), bound);
      EXPECT_EQ(plan.error_mm, made.Error(formats));
      for (size_t t = 0; t < formats.size(); ++t) {
        const FormatDecision& decision = plan.decisions[t];
        EXPECT_EQ(decision.format, formats[t]);
        EXPECT_EQ(decision.cheaper.has_value(), formats[t] != made.options[t].lowest);
        if (!decision.cheaper) continue;
        std::vector<Precision> lower = formats;
        lower[t] = *decision.cheaper;
        EXPECT_LT(Bytes(lower[t]), Bytes(formats[t]));
        EXPECT_GT(made.Error(lower), bound);
        EXPECT_EQ(decision.cheaper_mm, made.Error(lower));
      }
      // Against all combinations.
      uint64_t least = UINT64_MAX;
      std::vector<Precision> trial(formats.size(), Precision::kFp32);
      const std::function<void(size_t)> visit = [&](size_t t) {
        if (t == trial.size()) {
          if (made.Error(trial) <= bound) least = std::min(least, made.Size(trial));
          return;
        }
        for (const Precision f : {Precision::kInt8, Precision::kFp16, Precision::kFp32}) {
          if (Bytes(f) < Bytes(made.options[t].lowest)) continue;
          if (f == Precision::kFp16 && !made.options[t].has_halves) continue;
          trial[t] = f;
          visit(t + 1);
        }
      };
      visit(0);
      EXPECT_LE(static_cast<double>(made.Size(formats)), 1.6 * static_cast<double>(least)) << seed << " " << share;
      best += made.Size(formats) == least ? 1 : 0;
      mixed += std::string(plan.plan.name()) == "mixed" ? 1 : 0;
      ++count;
    }
  }
  EXPECT_GT(mixed, count / 3) << "too few cases where formats differ";
  EXPECT_GT(best, count / 2) << "the cheapest of all is found too rarely";
}

}  // namespace
}  // namespace dcloth::converter
