// Matrices to int8 with two-sided scales: W[j][c] ~ row_scales[j] * column_scales[c] * values[j][c]. The row scale is
// folded into the input vector and the column scale into the result, so both are free in the kernel's loop. Scales per
// group of rows (as in block formats) were measured slower on small cores: they break the 16-bit multiply-add.
#ifndef DCLOTH_CONVERTER_QUANTIZE_H_
#define DCLOTH_CONVERTER_QUANTIZE_H_

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "converter/bundle.h"

namespace dcloth::converter {

struct QuantizedMatrix {
  size_t rows = 0, columns = 0;
  std::vector<int8_t> values;        // [rows, columns] row-major, -127 to 127
  std::vector<float> row_scales;     // [rows], finite and positive, the largest is 1
  std::vector<float> column_scales;  // [columns], finite and positive
  double squared_error = 0;          // sum_j w_j sum_c (W - stored)^2
};

// Every |W - s t q| <= s t / 2 but for double rounding. Of several starts (plain per-column scales among them) the one
// with the smallest weighted squared error wins, so the result is never worse than per-column scales; ties go to the
// earlier start. `row_weights` [rows] are the inputs' mean squares, or empty for equal ones. Deterministic.
// Throws Error with `name` for an empty matrix or magnitudes that leave no positive float scale (above 1e30).
QuantizedMatrix QuantizeTwoSided(const std::string& name, const Matrix& weights,
                                 std::span<const double> row_weights = {});

// Row scales 1: the plain scheme, and the start that QuantizeTwoSided has to beat.
QuantizedMatrix QuantizePerColumn(const std::string& name, const Matrix& weights,
                                  std::span<const double> row_weights = {});

// Nearest halves; throws Error with `name` where a magnitude rounds past 65504.
std::vector<uint16_t> QuantizeHalf(const std::string& name, const Matrix& weights);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_QUANTIZE_H_
