// The choice of formats against every combination, with errors that are known.
#include "converter/choose_formats.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <map>
#include <optional>
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
      formats.push_back(Bytes(format) < Bytes(option.lowest)               ? option.lowest
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

// Formats as ranks of cost: what a tensor can be stored in, cheapest first.
std::vector<Precision> Ladder(const FormatOption& option) {
  if (option.lowest == Precision::kFp16) return {Precision::kFp16, Precision::kFp32};
  if (!option.has_halves) return {Precision::kInt8, Precision::kFp32};
  return {Precision::kInt8, Precision::kFp16, Precision::kFp32};
}

// The rules of the header written down once more, in rungs of each tensor's ladder: which models are measured in which
// order, and what comes out.
struct Plain {
  const std::vector<FormatOption>& options;
  const std::function<double(const std::vector<Precision>&)>& error_of;
  double bound;
  std::vector<std::vector<Precision>> measured = {};
  std::vector<size_t> rungs = {};
  std::vector<double> refused = {};
  double error = 0;

  double Measure(const std::vector<size_t>& at) {
    std::vector<Precision> formats;
    for (size_t t = 0; t < options.size(); ++t) formats.push_back(Ladder(options[t]).at(at[t]));
    measured.push_back(formats);
    return error_of(formats);
  }
  uint64_t Size(size_t t, size_t rung) const { return options[t].element_count * Bytes(Ladder(options[t]).at(rung)); }
  bool Choose() {
    rungs.assign(options.size(), 0);
    refused.assign(options.size(), 0);
    error = Measure(rungs);
    if (error <= bound) return true;
    std::vector<size_t> top;
    for (const FormatOption& option : options) top.push_back(Ladder(option).size() - 1);
    std::multimap<double, size_t, std::greater<>> steps;  // gain a byte; equal ones in the order of insertion
    for (size_t t = 0; t < options.size(); ++t) {
      std::vector<double> alone(top[t] + 1, 0);
      std::vector<size_t> trial = top;
      for (trial[t] = 0; trial[t] < top[t]; ++trial[t]) alone[trial[t]] = Measure(trial);
      double least = INFINITY;
      for (size_t rung = 0; rung < top[t]; ++rung) {
        const auto bytes = static_cast<double>(Size(t, rung + 1) - Size(t, rung));
        least = std::min(least, std::max(alone[rung] - alone[rung + 1], 0.0) / bytes);
        steps.emplace(least, t);
      }
    }
    for (const auto& [gain, t] : steps) {
      ++rungs[t];
      error = Measure(rungs);
      if (error <= bound) break;
    }
    if (error > bound) return false;
    for (bool lowered = true; lowered;) {
      lowered = false;
      std::multimap<uint64_t, size_t, std::greater<>> largest;
      for (size_t t = 0; t < options.size(); ++t) {
        if (rungs[t] > 0) largest.emplace(Size(t, rungs[t]) - Size(t, rungs[t] - 1), t);
      }
      for (const auto& [saved, t] : largest) {
        std::vector<size_t> trial = rungs;
        --trial[t];
        const double found = Measure(trial);
        refused[t] = found;
        if (found > bound) continue;
        rungs = trial;
        error = found;
        lowered = true;
      }
    }
    return true;
  }
};

// Errors of any kind: noise on top of the sum of squares, so that a dearer format may be worse, gain nothing, or gain
// more with its second step than with its first; sizes that are equal.
TEST(ChooseFormatsTest, EachStepIsThatOfThePlainRules) {
  size_t long_ones = 0, missed = 0;
  for (unsigned seed = 0; seed < 600; ++seed) {
    Made made = FromSeed(seed);
    for (FormatOption& option : made.options) {
      if (seed % 3 == 0) option.element_count = 100 + option.element_count % 2;
    }
    const std::function<double(const std::vector<Precision>&)> error = [&](const std::vector<Precision>& formats) {
      unsigned code = seed;
      for (const Precision format : formats) code = code * 3 + static_cast<unsigned>(format);
      std::mt19937 random(code);
      const double noise = static_cast<double>(random() % 1000) / 1000;
      const double sum = seed % 5 == 0 ? std::floor(made.Error(formats)) : made.Error(formats);
      return seed % 2 == 0 ? sum : sum * (0.2 + noise) + (seed % 7 == 0 ? noise : 0);
    };
    const double cheapest = error(made.Formats({Precision::kInt8, {}}));
    // Some bounds, and errors on the way themselves, which keep the bound.
    std::vector<double> bounds = {cheapest, 0.7 * cheapest, 0.2 * cheapest, 0.02 * cheapest};
    Plain tight{made.options, error, bounds[2]};
    tight.Choose();
    for (size_t i = 0; i < tight.measured.size(); i += 3) bounds.push_back(error(tight.measured[i]));
    for (const double bound : bounds) {
      Plain plain{made.options, error, bound};
      const bool good = plain.Choose();
      std::vector<std::vector<Precision>> measured;
      const std::optional<FormatPlan> plan = ChooseFormats(made.options, plain.bound, [&](const PrecisionPlan& asked) {
        measured.push_back(made.Formats(asked));
        return error(measured.back());
      });
      ASSERT_EQ(measured, plain.measured) << seed << " " << bound;
      ASSERT_EQ(plan.has_value(), good);
      long_ones += measured.size() > 20 ? 1 : 0;
      missed += good ? 0 : 1;
      if (!good) continue;
      EXPECT_EQ(plan->error_mm, plain.error);
      const std::vector<Precision> chosen = made.Formats(plan->plan);
      for (size_t t = 0; t < chosen.size(); ++t) {
        const std::vector<Precision> ladder = Ladder(made.options[t]);
        const FormatDecision& decision = plan->decisions.at(t);
        EXPECT_EQ(decision.tensor, made.options[t].tensor);
        EXPECT_EQ(chosen[t], ladder[plain.rungs[t]]);
        EXPECT_EQ(decision.format, chosen[t]);
        EXPECT_EQ(decision.cheaper, plain.rungs[t] == 0 ? std::nullopt : std::optional(ladder[plain.rungs[t] - 1]));
        EXPECT_EQ(decision.cheaper_mm, plain.rungs[t] == 0 ? 0 : plain.refused[t]);
      }
      // A name only where formats differ from what one precision alone gives.
      const bool uniform = chosen == made.Formats({Precision::kInt8, {}}) ||
                           chosen == made.Formats({Precision::kFp16, {}}) ||
                           chosen == made.Formats({Precision::kFp32, {}});
      EXPECT_EQ(plan->plan.formats.empty(), uniform);
      if (!uniform) {
        EXPECT_EQ(plan->plan.formats.size(), made.options.size());
      }
    }
  }
  EXPECT_GT(long_ones, 50u);
  EXPECT_GT(missed, 5u);
}

}  // namespace
}  // namespace dcloth::converter
