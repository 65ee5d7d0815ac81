// Every figure the tests find, in one table on stdout and one JSON file: what scripts/stability.sh makes a
// document of.
#ifndef DCLOTH_TESTS_STABILITY_RECORD_H_
#define DCLOTH_TESTS_STABILITY_RECORD_H_

#include <span>
#include <string>

#include "tests/stability/garment.h"

namespace dcloth::stability {

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

// Prints the table and writes the JSON to the file that the environment variable DCLOTH_STABILITY_JSON names,
// where it is set. Called once, after the last test; false where the file cannot be written.
bool WriteRecords();

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_RECORD_H_
