// Bodies of no shape at all against a plain reference.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <set>
#include <vector>

#include "converter/body_surface.h"
#include "kernels/nearest/nearest_order.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

// In the kernel's own order, which its tests hold to whole sorts.
std::vector<uint32_t> Ordered(const Matrix& positions, const std::vector<uint32_t>& vertices) {
  std::vector<float> own;
  for (const uint32_t v : vertices) own.insert(own.end(), {positions(v, 0), positions(v, 1), positions(v, 2)});
  std::vector<uint16_t> order(vertices.size());
  for (size_t i = 0; i < order.size(); ++i) order[i] = static_cast<uint16_t>(i);
  kernels::OrderByPlace(own.data(), order.data(), order.size());
  std::vector<uint32_t> out;
  for (const uint16_t i : order) out.push_back(vertices[i]);
  return out;
}

// Points on a coarse lattice, so that many are equally far along, and faces of any three; a joint that is no bone
// carries nothing, less than a thousandth or more of each. Marks, where there are any, leave some out.
Bundle WithCloud(uint32_t count, bool marked, std::mt19937* random) {
  Bundle bundle = WithWall(2, 2);
  const auto any = [&](uint32_t below) { return static_cast<int>((*random)() % below); };
  const Eigen::Index b = count, joints = bundle.body_joint_weights.cols();
  bundle.body_positions.resize(b, 3);
  bundle.body_joint_weights = Matrix::Zero(b, joints);
  bundle.body_faces.resize(2 * b, 3);
  if (marked) bundle.body_collides = Vector::Ones(b);
  for (Eigen::Index i = 0; i < b; ++i) {
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      bundle.body_positions(i, axis) = 0.06f * static_cast<float>(any(5 + 3 * (count % 3 == axis)) - 4);
    }
    const float other = std::array{0.0f, 0.0005f, 0.0015f, 0.5f}[i % 5 == 4 ? any(4) : any(2)];
    bundle.body_joint_weights(i, 0) = other;
    for (const float part : {0.5f, 0.25f, 0.25f}) {
      bundle.body_joint_weights(i, bundle.bones[static_cast<size_t>(any(4))]) += part * (1 - other);
    }
    if (marked && any(7) == 0) bundle.body_collides[i] = 0;
  }
  for (Eigen::Index f = 0; f < 2 * b; ++f) {
    const int first = any(count);
    for (int c = 0; c < 3; ++c) bundle.body_faces(f, c) = (first + c * (1 + any(count / 3))) % static_cast<int>(count);
  }
  return bundle;
}

TEST(BodySurfaceCloudTest, CloudsOfAnySizeAgreeWithAPlainReference) {
  std::mt19937 random(1);
  size_t several = 0, left_out = 0;
  for (uint32_t count = 9; count < 260; count += 1 + count / 24) {
    for (const bool marked : {false, true}) {
      const Bundle bundle = WithCloud(count, marked, &random);
      const auto carried = [&](Eigen::Index i) { return marked || bundle.body_joint_weights(i, 0) < 0.001f; };
      std::vector<Corners> faces;
      std::set<uint32_t> used;
      for (Eigen::Index f = 0; f < bundle.body_faces.rows(); ++f) {
        Corners face;
        bool all = true, near = false;
        for (int c = 0; c < 3; ++c) {
          const int32_t corner = bundle.body_faces(f, c);
          face[static_cast<size_t>(c)] = static_cast<uint32_t>(corner);
          all = all && (marked ? bundle.body_collides[corner] == 1 : carried(corner));
          for (Eigen::Index i = 0; i < bundle.template_positions.rows(); ++i) {
            near = near || (bundle.body_positions.row(corner) - bundle.template_positions.row(i)).norm() < 0.5f;
          }
        }
        if (!all || !near) continue;
        faces.push_back(face);
        used.insert(face.begin(), face.end());
      }
      const BodySurface surface = MakeBodySurface(bundle, 8);
      ASSERT_EQ(surface.vertices, Ordered(bundle.body_positions, {used.begin(), used.end()})) << count;
      ASSERT_EQ(surface.faces.size(), 3 * faces.size());
      std::vector<std::vector<uint32_t>> rings(surface.vertices.size());
      for (size_t f = 0; f < faces.size(); ++f) {
        for (size_t c = 0; c < 3; ++c) {
          ASSERT_EQ(surface.vertices[surface.faces[3 * f + c]], faces[f][c]);
          rings[surface.faces[3 * f + c]].push_back(static_cast<uint32_t>(f));
        }
      }
      std::vector<uint32_t> columns, starts = {0};
      for (const std::vector<uint32_t>& ring : rings) {
        columns.insert(columns.end(), ring.begin(), ring.end());
        starts.push_back(static_cast<uint32_t>(columns.size()));
      }
      EXPECT_EQ(surface.columns, columns);
      EXPECT_EQ(surface.row_starts, starts);
      several += surface.vertices.size() > 48 ? 1 : 0;
      left_out += faces.size() < 2 * count ? 1 : 0;
      if (surface.empty()) continue;

      ASSERT_EQ(surface.skin.vertex_count(), surface.vertices.size());
      for (size_t i = 0; i < surface.vertices.size(); ++i) {
        std::vector<double> expected(6), found(6);
        double sum = 0;
        for (size_t j = 0; j < 6; ++j) {
          const bool bone = std::find(bundle.bones.begin(), bundle.bones.end(), j) != bundle.bones.end();
          if (!marked && !bone) continue;
          const float weight = bundle.body_joint_weights(surface.vertices[i], static_cast<Eigen::Index>(j));
          expected[j] = static_cast<double>(weight);
          sum += expected[j];
        }
        for (size_t k = i * surface.skin.influences; k < (i + 1) * surface.skin.influences; ++k) {
          found.at(surface.skin.columns[k]) += static_cast<double>(surface.skin.weights[k]);
        }
        for (size_t j = 0; j < 6; ++j) ASSERT_NEAR(found[j], expected[j] / sum, 8 * 0x1p-24) << "joint " << j;
      }
    }
  }
  EXPECT_GT(several, 20u);
  EXPECT_GT(left_out, 40u);
}

}  // namespace
}  // namespace dcloth::converter
