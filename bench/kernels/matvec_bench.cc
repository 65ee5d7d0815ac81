// Matrix-vector products at the sizes of the skirt (n 7,952, k 128, h 256) and of the paper (n 7,964, k 768, h 1,024), and
// 400 x 23,900, the size of the prototypes: int8 with 16-bit coefficients 0.43 ms cold, 0.21 ms warm on Zen 3.
//
// Rejected: no prefetch, 0.57 ms cold; group-wise scales (a multiply per group and column instead of one per column);
// 4-bit weights (0.34 ms, ten times the error).
#include <algorithm>
#include <cmath>
#include <vector>

#include "bench/kernels/kernel_bench.h"
#include "kernels/matvec/matvec_pack.h"

namespace dcloth::kernels {
namespace {

enum class Kind { kF32, kF16, kI8 };

struct Problem {
  size_t rows, columns;
  std::vector<float> matrix, x;
  std::vector<double> exact;

  Problem(size_t r, size_t c) : rows(r), columns(c), matrix(r * c), x(r), exact(c) {
    std::mt19937 engine(7);
    std::uniform_real_distribution<float> distribution(-1, 1);
    for (float& value : matrix) value = distribution(engine);
    for (float& value : x) value = distribution(engine);
    for (size_t j = 0; j < r; ++j) {
      for (size_t i = 0; i < c; ++i) exact[i] += double{x[j]} * matrix[j * c + i];
    }
  }
  double Error(AlignedArray<float>& y) const {
    double error = 0;
    for (size_t i = 0; i < columns; ++i) error = std::max(error, std::fabs(y[i] - exact[i]));
    return error;
  }
};

void Run(benchmark::State& state, const KernelTable& table, bool cold, Kind kind, size_t rows, size_t columns) {
  const Problem problem(rows, columns);
  const MatrixShape shape = {rows, columns, columns, 1};
  const size_t panels = PanelCount(columns), elements = PanelElements(rows, columns);
  AlignedArray<float> y(PaddedColumns(columns));
  const double flops = 2.0 * static_cast<double>(rows * columns);
  if (kind == Kind::kF32) {
    AlignedArray<float> weights(elements);
    PackPanelsF32(problem.matrix.data(), shape, weights.data());
    const MatvecF32Job job = {problem.x.data(), weights.data(), nullptr, y.data(), rows, 0, rows, panels, false};
    table.matvec_f32(job);
    Measure(state, cold, 4.0 * elements, flops, problem.Error(y), [&] { table.matvec_f32(job); });
  } else if (kind == Kind::kF16) {
    AlignedArray<uint16_t> weights(elements);
    PackPanelsF16(problem.matrix.data(), shape, weights.data());
    const MatvecF16Job job = {problem.x.data(), weights.data(), nullptr, y.data(), rows, 0, rows, panels, false};
    table.matvec_f16(job);
    Measure(state, cold, 2.0 * elements, flops, problem.Error(y), [&] { table.matvec_f16(job); });
  } else {
    std::vector<int8_t> rounded(rows * columns);
    for (size_t i = 0; i < rounded.size(); ++i) {
      rounded[i] = static_cast<int8_t>(std::lround(problem.matrix[i] * 127.0f));
    }
    AlignedArray<int8_t> weights(PairPanelElements(rows, columns));
    PackPairPanelsI8(rounded.data(), shape, weights.data());
    AlignedArray<float> scales(PaddedColumns(columns));
    std::fill_n(scales.data(), scales.size(), 1.0f / 127.0f);
    AlignedArray<int16_t> q(PairedRows(rows));
    // Quantising the coefficients is part of every call.
    const auto call = [&] {
      float scale;
      table.quantize_i16({problem.x.data(), nullptr, q.data(), &scale, rows});
      table.matvec_i8({q.data(), weights.data(), scales.data(), nullptr, y.data(), scale, PairedRows(rows), 0,
                       PairedRows(rows), panels, false});
    };
    call();
    Measure(state, cold, static_cast<double>(weights.size()), flops, problem.Error(y), call);
  }
}

const bool kRegistered = [] {
  struct Size {
    const char* name;
    size_t rows, columns;
  };
  const Size sizes[] = {{"prototype", 400, 23900},    {"skirt_basis", 256, 23856}, {"skirt_vertex_mlp", 7952, 256},
                        {"skirt_gru_hidden", 128, 384}, {"paper_basis", 768, 23892}, {"paper_vertex_mlp", 7964, 1024}};
  for (const Size& size : sizes) {
    for (const auto& [kind, label] : {std::pair{Kind::kF32, "f32"}, {Kind::kF16, "f16"}, {Kind::kI8, "i8"}}) {
      ForEveryTable(std::string("matvec_") + label + "/" + size.name, [=, k = kind](auto& state, auto& table, bool cold) {
        Run(state, table, cold, k, size.rows, size.columns);
      });
    }
  }
  return true;
}();

}  // namespace
}  // namespace dcloth::kernels
