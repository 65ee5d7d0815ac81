// Bundles whose body is a plane wall, for tests of what collides.
#ifndef DCLOTH_TESTS_UNIT_CONVERTER_BODY_WALL_H_
#define DCLOTH_TESTS_UNIT_CONVERTER_BODY_WALL_H_

#include <array>
#include <cstdint>
#include <vector>

#include "converter/bundle.h"
#include "tests/unit/converter/bundle_builder.h"

namespace dcloth::testing {

// A face, by its vertices.
using Corners = std::array<uint32_t, 3>;

// A wall of `columns` x `rows` vertices, 0.05 m apart, along x through the template. Its left half hangs on the first
// bone, its right half on the first joint, which is no bone and needed by no one else.
inline converter::Bundle WithWall(int columns, int rows) {
  const BundleSpec spec{.feature_joints = 1};
  converter::Bundle bundle = ParseBundle(spec);
  const Eigen::Index b = Eigen::Index{columns} * rows, joints = bundle.body_joint_weights.cols();
  bundle.body_positions.resize(b, 3);
  bundle.body_joint_weights = converter::Matrix::Zero(b, joints);
  std::vector<int32_t> corners;
  for (int r = 0; r < rows; ++r) {
    for (int c = 0; c < columns; ++c) {
      const int i = r * columns + c;
      bundle.body_positions.row(i) << 0.05f * static_cast<float>(c - columns / 2), 0.05f * static_cast<float>(r), 0.0f;
      bundle.body_joint_weights(i, c < columns / 2 ? bundle.bones[0] : 0) = 1;
      if (c + 1 < columns && r + 1 < rows) {
        corners.insert(corners.end(), {i, i + 1, i + columns + 1, i, i + columns + 1, i + columns});
      }
    }
  }
  bundle.body_faces =
      Eigen::Map<const converter::Faces>(corners.data(), static_cast<Eigen::Index>(corners.size() / 3), 3);
  bundle.template_positions.rowwise() -= bundle.template_positions.row(0).eval();
  return bundle;
}

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_CONVERTER_BODY_WALL_H_
