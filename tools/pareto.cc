#include "tools/pareto.h"

#include <cmath>

namespace dcloth::tools {
namespace {

double Steps(const ParetoPoint& point) { return std::round(point.mm / kParetoStepMm); }

bool Dominates(const ParetoPoint& a, const ParetoPoint& b) {
  return a.ms <= b.ms && Steps(a) <= Steps(b) && (a.ms < b.ms || Steps(a) < Steps(b));
}

bool IsBetterWitness(const ParetoPoint& a, const ParetoPoint& b) {
  return Steps(a) < Steps(b) || (Steps(a) == Steps(b) && a.ms < b.ms);
}

}  // namespace

std::vector<std::optional<size_t>> DominatedBy(std::span<const ParetoPoint> points) {
  std::vector<std::optional<size_t>> by(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    for (size_t j = 0; j < points.size(); ++j) {
      if (Dominates(points[j], points[i]) && (!by[i] || IsBetterWitness(points[j], points[*by[i]]))) by[i] = j;
    }
  }
  return by;
}

}  // namespace dcloth::tools
