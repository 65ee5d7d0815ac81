#include "tools/baseline.h"

#include <algorithm>
#include <cmath>

#include "converter/error.h"

namespace dcloth::tools {

std::vector<double> InverseBind(const converter::Bundle& bundle) {
  std::vector<double> out(bundle.bind.size() * 12);
  for (size_t j = 0; j < bundle.bind.size(); ++j) {
    const auto at = [&](int r, int c) { return static_cast<double>(bundle.bind[j](r, c)); };
    double cofactor[3][3];  // cofactor[r][c] of the linear part
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) {
        const int r1 = (r + 1) % 3, r2 = (r + 2) % 3, c1 = (c + 1) % 3, c2 = (c + 2) % 3;
        cofactor[r][c] = at(r1, c1) * at(r2, c2) - at(r1, c2) * at(r2, c1);
      }
    }
    const double determinant = at(0, 0) * cofactor[0][0] + at(0, 1) * cofactor[0][1] + at(0, 2) * cofactor[0][2];
    if (!(std::abs(determinant) > 0)) {
      throw converter::Error({.path = bundle.path,
                              .tensor = "character.bind",
                              .found = "a bind matrix that has no inverse for joint '" + bundle.joint_names[j] + "'",
                              .expected = "invertible joint-to-world matrices",
                              .mend = "export the bind pose again"});
    }
    double* row = &out[12 * j];
    for (int r = 0; r < 3; ++r) {
      double translation = 0;
      for (int c = 0; c < 3; ++c) {
        row[4 * r + c] = cofactor[c][r] / determinant;
        translation -= row[4 * r + c] * at(c, 3);
      }
      row[4 * r + 3] = translation;
    }
  }
  return out;
}

void SkinningMatrices(std::span<const double> inverse_bind, std::span<const float> pose, std::span<float> matrices) {
  for (size_t j = 0; j * 16 < pose.size(); ++j) {
    const float* g = &pose[16 * j];
    const double* b = &inverse_bind[12 * j];
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 4; ++c) {
        double sum = c == 3 ? g[4 * r + 3] : 0.0;
        for (int k = 0; k < 3; ++k) sum += g[4 * r + k] * b[4 * k + c];
        matrices[12 * j + 4 * r + c] = static_cast<float>(sum);
      }
    }
  }
}

PlainSkinning::PlainSkinning(const converter::Bundle& bundle)
    : template_(bundle.template_positions.data(), static_cast<size_t>(bundle.template_positions.size())) {
  const auto vertices = bundle.initial_weights.rows(), bones = bundle.initial_weights.cols();
  row_starts_.push_back(0);
  for (auto i = 0 * vertices; i < vertices; ++i) {
    double sum = 0;
    for (auto j = 0 * bones; j < bones; ++j) sum += std::max(bundle.initial_weights(i, j), 0.0f);
    for (auto j = 0 * bones; j < bones; ++j) {
      const double weight = bundle.initial_weights(i, j);
      if (weight > 0) influences_.push_back({bundle.bones[static_cast<size_t>(j)], static_cast<float>(weight / sum)});
    }
    row_starts_.push_back(static_cast<uint32_t>(influences_.size()));
  }
}

void PlainSkinning::Skin(std::span<const float> matrices, std::span<float> positions) const {
  for (size_t i = 0; i + 1 < row_starts_.size(); ++i) {
    double sum[3] = {0, 0, 0};
    const float* t = &template_[3 * i];
    for (uint32_t k = row_starts_[i]; k < row_starts_[i + 1]; ++k) {
      const float* m = &matrices[size_t{influences_[k].joint} * 12];
      for (int r = 0; r < 3; ++r) {
        const double moved =
            double{m[4 * r]} * t[0] + double{m[4 * r + 1]} * t[1] + double{m[4 * r + 2]} * t[2] + m[4 * r + 3];
        sum[r] += influences_[k].weight * moved;
      }
    }
    for (int r = 0; r < 3; ++r) positions[3 * i + static_cast<size_t>(r)] = static_cast<float>(sum[r]);
  }
}

}  // namespace dcloth::tools
