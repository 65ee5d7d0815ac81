// A dense layer with random weights and its product in double, packed for the kernels in one of the three formats.
#ifndef DCLOTH_BENCH_KERNELS_DENSE_PROBLEM_H_
#define DCLOTH_BENCH_KERNELS_DENSE_PROBLEM_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "bench/kernels/kernel_bench.h"
#include "kernels/matvec/matvec_pack.h"

namespace dcloth::kernels {

enum class WeightKind { kF32, kF16, kI8 };

// y = x W with x and W in [-1, 1].
struct DenseProblem {
  size_t rows, columns;
  std::vector<float> matrix, x;  // [rows, columns], [rows]
  std::vector<double> exact;     // [columns]
  double magnitude = 0;          // largest sum of |x_j W_jc|

  DenseProblem(size_t r, size_t c) : rows(r), columns(c), matrix(r * c), x(r), exact(c) {
    std::mt19937 engine(7);
    std::uniform_real_distribution<float> distribution(-1, 1);
    for (float& value : matrix) value = distribution(engine);
    for (float& value : x) value = distribution(engine);
    std::vector<double> sums(c);
    for (size_t j = 0; j < r; ++j) {
      for (size_t i = 0; i < c; ++i) {
        const double product = double{x[j]} * matrix[j * c + i];
        exact[i] += product;
        sums[i] += std::fabs(product);
      }
    }
    magnitude = *std::max_element(sums.begin(), sums.end());
  }

  double Error(const float* y) const {
    double error = 0;
    for (size_t i = 0; i < columns; ++i) error = std::max(error, std::fabs(y[i] - exact[i]));
    return error;
  }

  // What rounding may cost: f32 a rounding a row, f16 also one a weight, int8 half a step of 1/127 a weight with
  // |x_j| <= 1 (that of the 16-bit coefficients is below a tenth of it).
  double ErrorBound(WeightKind kind) const {
    const double sums = static_cast<double>(rows + 2) * 0x1p-24 * magnitude;
    if (kind == WeightKind::kF16) return sums + 0x1p-11 * magnitude;
    return kind == WeightKind::kI8 ? sums + 0.55 / 127 * static_cast<double>(rows) : sums;
  }
};

// `problem` packed for the kernels; calls run it whole. Owns everything but the problem.
class PackedDense {
 public:
  PackedDense(const DenseProblem& problem, WeightKind kind)
      : problem_(problem), kind_(kind), y_(PaddedColumns(problem.columns)) {
    const MatrixShape shape = {problem.rows, problem.columns, problem.columns, 1};
    const size_t elements = PanelElements(problem.rows, problem.columns);
    if (kind == WeightKind::kF32) {
      PackPanelsF32(problem.matrix.data(), shape, (f32_ = AlignedArray<float>(elements)).data());
    } else if (kind == WeightKind::kF16) {
      PackPanelsF16(problem.matrix.data(), shape, (f16_ = AlignedArray<uint16_t>(elements)).data());
    } else {
      std::vector<int8_t> rounded(problem.matrix.size());
      for (size_t i = 0; i < rounded.size(); ++i) {
        rounded[i] = static_cast<int8_t>(std::lround(problem.matrix[i] * 127.0f));
      }
      i8_ = AlignedArray<int8_t>(PairPanelElements(problem.rows, problem.columns));
      PackPairPanelsI8(rounded.data(), shape, i8_.data());
      scales_ = AlignedArray<float>(PaddedColumns(problem.columns));
      std::fill_n(scales_.data(), scales_.size(), 1.0f / 127.0f);
      q_ = AlignedArray<int16_t>(PairedRows(problem.rows));
    }
  }

  // Quantising the coefficients is part of every int8 call.
  void Run(const KernelTable& table) {
    const size_t rows = problem_.rows, pairs = PairedRows(rows), panels = PanelCount(problem_.columns);
    const float* x = problem_.x.data();
    if (kind_ == WeightKind::kF32) {
      table.matvec_f32({x, f32_.data(), nullptr, y_.data(), rows, rows, panels, false});
    } else if (kind_ == WeightKind::kF16) {
      table.matvec_f16({x, f16_.data(), nullptr, y_.data(), rows, rows, panels, false});
    } else {
      float scale;
      table.quantize_i16({x, nullptr, q_.data(), &scale, rows});
      table.matvec_i8({q_.data(), i8_.data(), scales_.data(), nullptr, y_.data(), scale, pairs, pairs, panels, false});
    }
  }

  const float* y() { return y_.data(); }
  size_t weight_bytes() const { return 4 * f32_.size() + 2 * f16_.size() + i8_.size(); }
  const uint8_t* weights() {
    const void* data = kind_ == WeightKind::kF32   ? static_cast<const void*>(f32_.data())
                       : kind_ == WeightKind::kF16 ? static_cast<const void*>(f16_.data())
                                                   : i8_.data();
    return static_cast<const uint8_t*>(data);
  }

 private:
  const DenseProblem& problem_;
  WeightKind kind_;
  AlignedArray<float> f32_{0}, scales_{0}, y_;
  AlignedArray<uint16_t> f16_{0};
  AlignedArray<int8_t> i8_{0};
  AlignedArray<int16_t> q_{0};
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_BENCH_KERNELS_DENSE_PROBLEM_H_
