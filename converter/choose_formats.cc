#include "converter/choose_formats.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace dcloth::converter {
namespace {

constexpr uint64_t ElementBytes(Precision format) {
  return format == Precision::kFp32 ? 4 : format == Precision::kFp16 ? 2 : 1;
}

Precision Raised(const FormatOption& option, Precision format) {
  return format == Precision::kInt8 && option.has_halves ? Precision::kFp16 : Precision::kFp32;
}

Precision Lowered(const FormatOption& option, Precision format) {
  return format == Precision::kFp32 && option.has_halves ? Precision::kFp16 : Precision::kInt8;
}

class Chooser {
 public:
  Chooser(std::span<const FormatOption> options, double bound_mm, const MeasurePlan& measure)
      : options_(options), bound_mm_(bound_mm), measure_(measure), refused_mm_(options.size()) {
    for (const FormatOption& option : options) formats_.push_back(option.lowest);
  }

  std::optional<FormatPlan> Choose() {
    FormatPlan result;
    result.error_mm = Measure(formats_);
    if (result.error_mm > bound_mm_) {
      if (!Raise(&result.error_mm)) return std::nullopt;
      while (Lower(&result.error_mm)) {
      }
    }
    result.plan = PlanOf(formats_);
    for (size_t t = 0; t < options_.size(); ++t) {
      FormatDecision decision{options_[t].tensor, formats_[t], {}, 0};
      if (formats_[t] != options_[t].lowest) {
        decision.cheaper = Lowered(options_[t], formats_[t]);
        decision.cheaper_mm = refused_mm_[t];
      }
      result.decisions.push_back(std::move(decision));
    }
    return result;
  }

 private:
  using Formats = std::vector<Precision>;

  // A uniform plan names no tensor; else those that differ from what int8 asks for.
  PrecisionPlan PlanOf(const Formats& formats) const {
    PrecisionPlan plan{Precision::kInt8, {}, {}};
    for (const Precision uniform : {Precision::kInt8, Precision::kFp16, Precision::kFp32}) {
      plan = {uniform, {}, {}};
      for (size_t t = 0; t < options_.size(); ++t) {
        if (formats[t] != InUniform(options_[t], uniform)) plan.formats[options_[t].tensor] = formats[t];
      }
      if (plan.formats.empty()) return plan;
    }
    plan = {*std::min_element(formats.begin(), formats.end(), Cheaper), {}, {}};
    for (size_t t = 0; t < options_.size(); ++t) plan.formats[options_[t].tensor] = formats[t];
    return plan;
  }

  // What Assemble stores an option in where all are asked for in `uniform`.
  static Precision InUniform(const FormatOption& option, Precision uniform) {
    const Precision format = std::max(uniform, option.lowest, Cheaper);
    return format == Precision::kFp16 && !option.has_halves ? Precision::kFp32 : format;
  }

  static bool Cheaper(Precision a, Precision b) { return ElementBytes(a) < ElementBytes(b); }

  double Measure(const Formats& formats) const { return measure_(PlanOf(formats)); }

  // What each tensor costs alone, all others in float32; float32 costs nothing.
  double Alone(size_t t, Precision format) const {
    if (format == Precision::kFp32) return 0;
    Formats formats(options_.size(), Precision::kFp32);
    formats[t] = format;
    return Measure(formats);
  }

  bool Raise(double* error_mm) {
    struct Step {
      size_t tensor;
      double gain_per_byte;
    };
    std::vector<Step> steps;  // a tensor's first step always comes before its second
    for (size_t t = 0; t < options_.size(); ++t) {
      double before = Alone(t, options_[t].lowest), least = std::numeric_limits<double>::infinity();
      for (Precision f = options_[t].lowest; f != Precision::kFp32; f = Raised(options_[t], f)) {
        const Precision raised = Raised(options_[t], f);
        const double after = Alone(t, raised);
        const auto bytes = static_cast<double>(options_[t].element_count * (ElementBytes(raised) - ElementBytes(f)));
        least = std::min(least, std::max(before - after, 0.0) / std::max(bytes, 1.0));
        steps.push_back({t, least});
        before = after;
      }
    }
    std::stable_sort(steps.begin(), steps.end(),
                     [](const Step& a, const Step& b) { return a.gain_per_byte > b.gain_per_byte; });
    for (const Step& step : steps) {
      formats_[step.tensor] = Raised(options_[step.tensor], formats_[step.tensor]);
      *error_mm = Measure(formats_);
      if (*error_mm <= bound_mm_) return true;
    }
    return false;
  }

  // One pass over what is above its lowest format. False where nothing could be lowered: refused_mm_ then holds why.
  bool Lower(double* error_mm) {
    std::vector<size_t> order;
    for (size_t t = 0; t < options_.size(); ++t) {
      if (formats_[t] != options_[t].lowest) order.push_back(t);
    }
    const auto saved = [&](size_t t) {
      return options_[t].element_count * (ElementBytes(formats_[t]) - ElementBytes(Lowered(options_[t], formats_[t])));
    };
    std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) { return saved(a) > saved(b); });
    bool lowered = false;
    for (const size_t t : order) {
      Formats trial = formats_;
      trial[t] = Lowered(options_[t], trial[t]);
      const double error = Measure(trial);
      if (error <= bound_mm_) {
        formats_ = std::move(trial);
        *error_mm = error;
        lowered = true;
      } else {
        refused_mm_[t] = error;
      }
    }
    return lowered;
  }

  std::span<const FormatOption> options_;
  double bound_mm_;
  const MeasurePlan& measure_;
  Formats formats_;
  std::vector<double> refused_mm_;
};

}  // namespace

std::optional<FormatPlan> ChooseFormats(std::span<const FormatOption> options, double bound_mm,
                                        const MeasurePlan& measure) {
  return Chooser(options, bound_mm, measure).Choose();
}

}  // namespace dcloth::converter
