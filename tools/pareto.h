// Which of several measured variants are worth choosing between.
#ifndef DCLOTH_TOOLS_PARETO_H_
#define DCLOTH_TOOLS_PARETO_H_

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

namespace dcloth::tools {

struct ParetoPoint {
  double ms = 0, mm = 0;
};

// Errors that round to the same multiple count as equal: nobody buys a thousandth of a millimetre with time.
constexpr double kParetoStepMm = 0.01;

// Per point the one that dominates it: neither slower nor, in steps of kParetoStepMm, less exact, and better in one of
// the two. Of several the most exact, then the fastest, which nothing dominates itself. Empty for points of the front;
// equal points are all on it or all off it.
std::vector<std::optional<size_t>> DominatedBy(std::span<const ParetoPoint> points);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PARETO_H_
