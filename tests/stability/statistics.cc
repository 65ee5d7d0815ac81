#include "tests/stability/statistics.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace dcloth::stability {
namespace {

// The continued fraction of I_x(a, b) by Lentz's method; converges fast for x < (a + 1) / (a + b + 2).
double BetaFraction(double x, double a, double b) {
  constexpr double kTiny = 1e-300;
  const auto floor = [](double value) { return std::abs(value) < kTiny ? kTiny : value; };
  double c = 1, d = 1 / floor(1 - (a + b) * x / (a + 1)), fraction = d;
  for (int m = 1; m < 10000; ++m) {
    const double even = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    d = 1 / floor(1 + even * d);
    c = floor(1 + even / c);
    fraction *= c * d;
    const double odd = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 / floor(1 + odd * d);
    c = floor(1 + odd / c);
    fraction *= c * d;
    if (std::abs(c * d - 1) < 1e-15) break;
  }
  return fraction;
}

double IncompleteBeta(double x, double a, double b) {
  if (x <= 0 || x >= 1) return x <= 0 ? 0 : 1;
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x));
  return x < (a + 1) / (a + b + 2) ? front * BetaFraction(x, a, b) / a : 1 - front * BetaFraction(1 - x, b, a) / b;
}

}  // namespace

Slope FitSlope(std::span<const double> y) {
  const auto n = static_cast<double>(y.size());
  const double middle = (n - 1) / 2, mean = Mean(y);
  double sxx = 0, sxy = 0;
  for (size_t i = 0; i < y.size(); ++i) {
    const double x = static_cast<double>(i) - middle;
    sxx += x * x;
    sxy += x * (y[i] - mean);
  }
  Slope slope;
  slope.value = sxy / sxx;
  slope.degrees = y.size() - 2;
  double squares = 0;
  for (size_t i = 0; i < y.size(); ++i) {
    const double residual = y[i] - mean - slope.value * (static_cast<double>(i) - middle);
    squares += residual * residual;
  }
  slope.standard_error = std::sqrt(squares / (n - 2) / sxx);
  if (slope.standard_error > 0) {
    slope.t = slope.value / slope.standard_error;
  } else if (slope.value != 0) {
    slope.t = std::copysign(std::numeric_limits<double>::infinity(), slope.value);
  }
  return slope;
}

double TwoSidedP(double t, size_t degrees) {
  const auto v = static_cast<double>(degrees);
  if (!std::isfinite(t)) return 0;
  return IncompleteBeta(v / (v + t * t), v / 2, 0.5);
}

double OneSidedP(double t, size_t degrees) {
  const double half = TwoSidedP(t, degrees) / 2;
  return t >= 0 ? half : 1 - half;
}

double Mean(std::span<const double> values) {
  return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double Quantile(std::vector<double> values, double fraction) {
  const auto rank = static_cast<size_t>(std::ceil(fraction * static_cast<double>(values.size())));
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(std::max<size_t>(rank, 1) - 1);
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

}  // namespace dcloth::stability
