// The undisturbed garment: its error to the simulated truth, and how exactly that error is known.
#ifndef DCLOTH_TESTS_STABILITY_BASELINE_H_
#define DCLOTH_TESTS_STABILITY_BASELINE_H_

#include "tests/stability/garment.h"

namespace dcloth::stability {

// E_d over the garment's clips. "Back to baseline" means: the error to the truth differs from that of an
// undisturbed run by no more than the standard error with which the baseline itself is known (from means of
// batches of a second).
struct Baseline {
  double mean_mm = 0;
  double standard_error_mm = 0;
};

// Measured once per garment and precision.
const Baseline& BaselineOf(const Garment& garment, Precision precision);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_BASELINE_H_
