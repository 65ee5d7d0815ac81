// `--precision auto`: per tensor the cheapest format that keeps the whole model within a bound.
#ifndef DCLOTH_CONVERTER_CHOOSE_FORMATS_H_
#define DCLOTH_CONVERTER_CHOOSE_FORMATS_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "converter/assemble.h"
#include "converter/precision.h"

namespace dcloth::converter {

// A matrix whose format is open.
struct FormatOption {
  std::string tensor;  // "displacement.basis.weights"
  Precision lowest;    // what Assemble stores it in when int8 is asked for
  uint64_t element_count = 0;
  bool has_halves = true;  // else the next format above int8 is float32
};

// Why a tensor is stored as it is.
struct FormatDecision {
  std::string tensor;
  Precision format;
  std::optional<Precision> cheaper;  // the next cheaper format; none where there is none
  // The error, mm, of the model with this tensor in `cheaper` and all others as chosen: above the bound.
  double cheaper_mm = 0;
};

struct FormatPlan {
  PrecisionPlan plan;
  std::vector<FormatDecision> decisions;  // in the order of the options
  double error_mm = 0;                    // of the chosen model, as `measure` gave it
};

// What an error is measured by: of a whole model in these formats, mm. The same plan gives the same error.
using MeasurePlan = std::function<double(const PrecisionPlan& plan)>;

// All in the cheapest format where that keeps the bound. Else tensors are raised, those first that give most of their
// own error back for a byte, until the bound is kept; then whatever can be lowered again is, the largest first, until
// nothing can: no single tensor of the answer can be stored one format cheaper. Not every combination is tried (3^9 of
// them), so a cheaper one may exist in which several tensors change places. Empty where even float32 misses the bound.
// Cost: one measurement where the cheapest is good; else about six per tensor.
std::optional<FormatPlan> ChooseFormats(std::span<const FormatOption> options, double bound_mm,
                                        const MeasurePlan& measure);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_CHOOSE_FORMATS_H_
