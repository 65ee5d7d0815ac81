// The parameter of every test here, one garment in one precision, and the record of every figure that the tests find:
// one table on stdout and one JSON file, of which scripts/stability.sh makes a document.
#ifndef DCLOTH_TESTS_STABILITY_STABILITY_CASE_H_
#define DCLOTH_TESTS_STABILITY_STABILITY_CASE_H_

#include <gtest/gtest.h>

#include <span>
#include <string>
#include <tuple>

#include "tests/stability/garment.h"

namespace dcloth::stability {

// No vertex lies farther than this many times the garment's size from the hips.
constexpr double kLargestReach = 2.0;

// Of what a disturbance moved the garment by, this much may be left a second later. E_d then changes by no more, as a
// mean of distances changes by less than the points move. Loose cloth swings for more than a second, and a network that
// plays it remembers as long. Its simulation forgets more slowly: entered half a second late, a walk is 3 mm from
// itself after one second and after three, 30 % of what it was; runs and dances are 10 to 40 mm from themselves.
constexpr double kLeftAfterASecond = 0.2;
// What three seconds leave of any past, mean over vertices, in mm: less than anybody sees.
constexpr double kForgottenMm = 1;

// What a garment that is at rest may still move in a tick, any vertex, in mm.
constexpr double kJitterMm = 0.01;

// The same six seconds after the character stopped in any pose, also beyond those of training. What is bundled creeps
// by up to 0.16 there; a network that is not stable swings by several.
constexpr double kRestlessMm = 0.25;

using CaseParameter = std::tuple<std::string, Precision>;

inline std::string CaseName(const testing::TestParamInfo<CaseParameter>& info) {
  return std::get<0>(info.param) + "_" + converter::PrecisionName(std::get<1>(info.param));
}

class StabilityCase : public testing::TestWithParam<CaseParameter> {
 protected:
  const Garment& garment() const { return LoadGarment(std::get<0>(GetParam())); }
  Precision precision() const { return std::get<1>(GetParam()); }
  size_t ticks_per_second() const {
    return static_cast<size_t>(0.5 + 1 / static_cast<double>(garment().model(precision()).info().tick_seconds));
  }
};

// An empty models/ is a failure: GoogleTest refuses a suite without instances.
#define DCLOTH_STABILITY_SUITE(suite) \
  INSTANTIATE_TEST_SUITE_P(           \
      Models, suite, testing::Combine(testing::ValuesIn(GarmentNames()), testing::ValuesIn(kPrecisions)), CaseName)

enum class Allowed { kAtMost, kAtLeast, kAnything };

struct Figure {
  const char* name;  // "jitter after settling"
  double value = 0;
  const char* unit = "";
  Allowed allowed = Allowed::kAnything;
  double bound = 0;
};

// Keeps a row and fails the running test where the figure misses its bound (NaN always does). `tick_ms` are
// the times of the case's own ticks, warm caches: a figure never stands without its price.
void Record(const Garment& garment, Precision precision, const std::string& test, std::span<const double> tick_ms,
            const Figure& figure);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_STABILITY_CASE_H_
