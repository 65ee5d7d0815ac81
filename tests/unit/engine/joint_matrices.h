// Joint matrices of tests: row-major [joints, 16] floats as a host holds them.
#pragma once
#include <vector>

#include "engine/src/pose/affine.h"
#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

inline engine::Affine At(const std::vector<float>& matrices, size_t joint) {
  engine::Affine a;
  for (size_t i = 0; i < 12; ++i) a.m[i / 4][i % 4] = static_cast<double>(matrices[16 * joint + i]);
  return a;
}

inline void Put(const engine::Affine& a, std::vector<float>* matrices) {
  for (size_t i = 0; i < 12; ++i) matrices->push_back(static_cast<float>(a.m[i / 4][i % 4]));
  matrices->insert(matrices->end(), {0, 0, 0, 1});
}

// B_j of the first `joints` joints: the model's inverses are rigid.
inline std::vector<float> BindMatrices(const Numbers& numbers, size_t joints) {
  std::vector<float> bind;
  for (size_t j = 0; j < joints; ++j) {
    const double* inverse = &numbers.inverse_bind[12 * j];
    engine::Affine b = {};
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        b.m[r][c] = inverse[4 * c + r];
        b.m[r][3] -= inverse[4 * c + r] * inverse[4 * c + 3];
      }
    }
    Put(b, &bind);
  }
  return bind;
}

}  // namespace dcloth::testing
