// Checks of numbers on the command line. CLI11's Range and PositiveNumber let NaN through, and a bound of NaN is never
// missed.
#ifndef DCLOTH_TOOLS_NUMBER_CHECK_H_
#define DCLOTH_TOOLS_NUMBER_CHECK_H_

#include "tools/cli.h"

namespace dcloth::tools {

// Numbers from `low` to `high`.
CLI::Validator NumberWithin(double low, double high);

// Numbers above 0, finite.
CLI::Validator NumberAboveZero();

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_NUMBER_CHECK_H_
