// Straight lines through figures over time, and whether their slope is distinguishable from zero.
#ifndef DCLOTH_TESTS_STABILITY_STATISTICS_H_
#define DCLOTH_TESTS_STABILITY_STATISTICS_H_

#include <cstddef>
#include <span>
#include <vector>

namespace dcloth::stability {

// Ordinary least squares of y over 0, 1, 2, ...
struct Slope {
  double value = 0;           // per step
  double standard_error = 0;  // 0 where all points lie on the line
  double t = 0;               // value / standard_error; 0 for a flat exact line
  size_t degrees = 0;         // of freedom: points - 2
};
Slope FitSlope(std::span<const double> y);  // at least 3 points

// P(|T| >= |t|) of Student's distribution with `degrees` of freedom: the regularised incomplete beta function
// I_{v / (v + t^2)}(v / 2, 1 / 2), by its continued fraction (Abramowitz and Stegun 26.5.8). Relative error
// below 1e-10.
double TwoSidedP(double t, size_t degrees);

// P(T >= t).
double OneSidedP(double t, size_t degrees);

double Mean(std::span<const double> values);

// Nearest rank; `fraction` in (0, 1].
double Quantile(std::vector<double> values, double fraction);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_STATISTICS_H_
