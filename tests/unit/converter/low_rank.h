// Bundles whose stacked basis has a known rank.
#ifndef DCLOTH_TESTS_UNIT_CONVERTER_LOW_RANK_H_
#define DCLOTH_TESTS_UNIT_CONVERTER_LOW_RANK_H_

#include <cstdint>

#include "converter/bundle.h"
#include "kernels/half.h"

namespace dcloth::testing {

// All rows of S and M become combinations of S's first `rank` rows; `halves` then rounds them as F16 bundles do. The
// mixing numbers are the same on every machine.
inline void LowerRank(converter::Bundle* bundle, uint32_t rank, bool halves = false) {
  using converter::Matrix;
  const converter::MatrixD rows = bundle->skeleton->basis.topRows(rank).cast<double>();
  uint32_t state = 12345;
  const auto next = [&] {
    state = state * 1664525u + 1013904223u;  // Numerical Recipes' generator
    return static_cast<double>(state >> 8) * 0x1p-23 - 1;
  };
  const auto mix = [&](Matrix* basis, double size) {
    for (Eigen::Index j = 0; j < basis->rows(); ++j) {
      Eigen::RowVectorXd row = Eigen::RowVectorXd::Zero(rows.cols());
      for (uint32_t i = 0; i < rank; ++i) row += size * next() * rows.row(i);
      basis->row(j) = row.cast<float>();
    }
    if (!halves) return;
    *basis = basis->unaryExpr([](float x) { return kernels::FloatFromHalf(kernels::HalfFromFloat(x)); }).eval();
  };
  mix(&bundle->skeleton->basis, 1.0);
  if (bundle->mesh) mix(&bundle->mesh->basis, 0.3);
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_CONVERTER_LOW_RANK_H_
