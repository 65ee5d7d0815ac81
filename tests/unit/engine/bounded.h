// A value in double beside a bound on how far any float evaluation of the same formula may be from it.
//
// Running error analysis (Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., section 3.3), but
// independent of the order of summation: each operation adds its own rounding, a product of n terms gamma_(n+2) of the
// sum of magnitudes (lemma 3.1). Fused multiply-adds round less often and stay inside.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_BOUNDED_H_
#define DCLOTH_TESTS_UNIT_ENGINE_BOUNDED_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "kernels/activation/tanh_rational.h"

namespace dcloth::testing {

constexpr double kUnit = 0x1p-24;
constexpr double kTiniest = 0x1p-126;  // what flushing a subnormal may lose

inline double Gamma(double k) { return k * kUnit / (1 - k * kUnit); }

struct Bounded {
  double value = 0;
  double error = 0;
};

// `value` after one more rounding to float.
inline Bounded Rounded(double value, double error = 0) {
  return {value, error + kUnit * (std::abs(value) + error) + kTiniest};
}

inline Bounded operator+(const Bounded& a, const Bounded& b) { return Rounded(a.value + b.value, a.error + b.error); }
inline Bounded operator-(const Bounded& a, const Bounded& b) { return Rounded(a.value - b.value, a.error + b.error); }
inline Bounded operator*(const Bounded& a, const Bounded& b) {
  return Rounded(a.value * b.value, std::abs(a.value) * b.error + std::abs(b.value) * a.error + a.error * b.error);
}

// (1 - w) from + w to in any of its forms, w in [0, 1]: its slopes are 1 - w, w and to - from. At most four roundings
// of terms no larger than |from| + |to|.
inline Bounded Mix(const Bounded& from, const Bounded& to, const Bounded& w) {
  const double inputs = from.error + to.error, size = std::abs(from.value) + std::abs(to.value) + inputs;
  return {from.value + w.value * (to.value - from.value), (1 - w.value) * from.error + w.value * to.error +
                                                              std::abs(to.value - from.value) * w.error +
                                                              w.error * inputs + 2 * Gamma(4) * size + kTiniest};
}

// 1 / sqrt(a) for a - a.error > 0: the slope is largest at the interval's lower end. Two roundings.
inline Bounded InverseSquareRoot(const Bounded& a) {
  const double low = a.value - a.error;
  if (low <= 0) return {1 / std::sqrt(a.value), INFINITY};
  const Bounded root = Rounded(1 / std::sqrt(a.value), 0.5 * a.error / (low * std::sqrt(low)));
  return Rounded(root.value, root.error);
}

// Slopes 1 and 1/4; the kernels' stated error, which a sigmoid by tanh(x/2) halves.
inline Bounded Tanh(const Bounded& a) { return Rounded(std::tanh(a.value), a.error + kernels::kTanhSharedMaxError); }
inline Bounded Sigmoid(const Bounded& a) {
  return Rounded(1 / (1 + std::exp(-a.value)), a.error / 4 + kernels::kTanhSharedMaxError);
}

inline Bounded Relu(const Bounded& a) { return {std::max(a.value, 0.0), a.error}; }

// sum_j x_j w_j + bias in any order.
class Sum {
 public:
  void Add(const Bounded& x, double weight) {
    value_ += x.value * weight;
    magnitude_ += (std::abs(x.value) + x.error) * std::abs(weight);
    error_ += x.error * std::abs(weight);
    ++terms_;
  }
  void AddError(double error) { error_ += error; }
  Bounded Total(double roundings_more = 2) const {
    return {value_, error_ + Gamma(static_cast<double>(terms_) + roundings_more) * magnitude_ + kTiniest};
  }

 private:
  double value_ = 0, magnitude_ = 0, error_ = 0;
  size_t terms_ = 0;
};

using Vector = std::vector<Bounded>;

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_BOUNDED_H_
