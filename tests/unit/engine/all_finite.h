// What every output must be, whatever came in.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_ALL_FINITE_H_
#define DCLOTH_TESTS_UNIT_ENGINE_ALL_FINITE_H_

#include <algorithm>
#include <cmath>
#include <vector>

namespace dcloth::testing {

inline bool AllFinite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); });
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_ALL_FINITE_H_
