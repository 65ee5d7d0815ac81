#include "converter/coarse_mesh.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace dcloth::converter {
namespace {

struct Sheet {
  Matrix positions;
  Faces faces;
};

// side x side vertices, `height` of each, metres; closed to a tube about y where asked.
template <typename Height>
Sheet MakeSheet(int side, bool tube, const Height& height) {
  Sheet sheet = {Matrix(side * side, 3), Faces(2 * (side - 1) * (tube ? side : side - 1), 3)};
  for (int r = 0; r < side; ++r) {
    for (int c = 0; c < side; ++c) {
      const double angle = 2 * M_PI * c / side, x = 0.01 * c, y = 0.01 * r;
      if (tube) {
        sheet.positions.row(r * side + c) << static_cast<float>(0.2 * std::cos(angle)), static_cast<float>(y),
            static_cast<float>(0.2 * std::sin(angle));
      } else {
        sheet.positions.row(r * side + c) << static_cast<float>(x), static_cast<float>(y),
            static_cast<float>(height(x, y));
      }
    }
  }
  int f = 0;
  for (int r = 0; r + 1 < side; ++r) {
    for (int c = 0; c < (tube ? side : side - 1); ++c) {
      const int a = r * side + c, b = r * side + (c + 1) % side, d = a + side, e = b + side;
      sheet.faces.row(f++) << a, b, d;
      sheet.faces.row(f++) << b, e, d;
    }
  }
  return sheet;
}

using Edge = std::pair<uint32_t, uint32_t>;

std::map<Edge, int> EdgesOf(const CoarseMesh& mesh) {
  std::map<Edge, int> edges;
  for (size_t f = 0; f < mesh.faces.size(); f += 3) {
    for (size_t c = 0; c < 3; ++c) {
      const uint32_t a = mesh.faces[f + c], b = mesh.faces[f + (c + 1) % 3];
      ++edges[{std::min(a, b), std::max(a, b)}];
    }
  }
  return edges;
}

Eigen::Vector3d Area(const Sheet& sheet, const CoarseMesh& mesh, size_t f) {
  const auto at = [&](size_t corner) -> Eigen::Vector3d {
    return sheet.positions.row(mesh.vertices[mesh.faces[f + corner]]).transpose().cast<double>();
  };
  return 0.5 * (at(1) - at(0)).cross(at(2) - at(0));
}

void ExpectSound(const CoarseMesh& mesh) {
  EXPECT_TRUE(std::is_sorted(mesh.vertices.begin(), mesh.vertices.end()));
  std::set<uint32_t> used(mesh.faces.begin(), mesh.faces.end());
  EXPECT_EQ(used.size(), mesh.vertices.size()) << "each vertex in a face";
  EXPECT_LT(*used.rbegin(), mesh.vertices.size());
  for (const auto& [edge, faces] : EdgesOf(mesh)) EXPECT_LE(faces, 2) << edge.first << " " << edge.second;
}

long EulerNumber(const CoarseMesh& mesh) {
  return static_cast<long>(mesh.vertices.size()) - static_cast<long>(EdgesOf(mesh).size()) +
         static_cast<long>(mesh.faces.size() / 3);
}

// A flat sheet loses vertices but nothing of its plane, of its outline and of the side it faces.
TEST(CoarseMeshTest, FlatSheetKeepsItsOutline) {
  const Sheet sheet = MakeSheet(30, false, [](double, double) { return 0.0; });
  const CoarseMesh mesh = MakeCoarseMesh(sheet.positions, sheet.faces, 450);
  ASSERT_EQ(mesh.vertices.size(), 450u);
  ExpectSound(mesh);
  EXPECT_EQ(EulerNumber(mesh), 1);
  double area = 0;
  for (size_t f = 0; f < mesh.faces.size(); f += 3) {
    const Eigen::Vector3d part = Area(sheet, mesh, f);
    EXPECT_GT(part.z(), 0);
    area += part.z();
  }
  EXPECT_NEAR(area, static_cast<double>(sheet.positions(899, 0)) * static_cast<double>(sheet.positions(899, 1)), 1e-8);
}

TEST(CoarseMeshTest, TubeStaysATube) {
  const Sheet sheet = MakeSheet(30, true, [](double, double) { return 0.0; });
  const CoarseMesh mesh = MakeCoarseMesh(sheet.positions, sheet.faces, 450);
  ASSERT_EQ(mesh.vertices.size(), 450u);
  ExpectSound(mesh);
  EXPECT_EQ(EulerNumber(mesh), 0);
  // Both hems are whole: each is a circle of border edges.
  std::map<uint32_t, int> ends;
  for (const auto& [edge, faces] : EdgesOf(mesh)) {
    if (faces == 1) ++ends[edge.first], ++ends[edge.second];
  }
  double low = 0, high = 0;
  for (const auto& [vertex, count] : ends) {
    EXPECT_EQ(count, 2);
    const float y = sheet.positions(mesh.vertices[vertex], 1);
    EXPECT_TRUE(y == 0.0f || y == sheet.positions(899, 1)) << y;
    (y == 0.0f ? low : high) += 1;
  }
  EXPECT_GE(low, 6);
  EXPECT_GE(high, 6);
}

// A pleat 5 mm high: the vertices that go are those of the flat parts. Every vertex that went lies within a tenth of
// the pleat's height of the coarse surface (seen from above, as the sheet is a graph over its plane).
TEST(CoarseMeshTest, PleatsStay) {
  const auto height = [](double x, double) { return std::max(0.0, 0.005 - std::fabs(x - 0.15) * 0.5); };
  const Sheet sheet = MakeSheet(30, false, height);
  const CoarseMesh mesh = MakeCoarseMesh(sheet.positions, sheet.faces, 450);
  ASSERT_EQ(mesh.vertices.size(), 450u);
  double worst = 0;
  for (Eigen::Index v = 0; v < sheet.positions.rows(); ++v) {
    const Eigen::Vector3d p = sheet.positions.row(v).transpose().cast<double>();
    double nearest = 1;
    for (size_t f = 0; f < mesh.faces.size(); f += 3) {
      const auto at = [&](size_t corner) -> Eigen::Vector3d {
        return sheet.positions.row(mesh.vertices[mesh.faces[f + corner]]).transpose().cast<double>();
      };
      const Eigen::Vector3d a = at(0), b = at(1), c = at(2);
      const double whole = (b - a).head<2>().x() * (c - a).y() - (b - a).y() * (c - a).x();
      const double u = ((p - a).x() * (c - a).y() - (p - a).y() * (c - a).x()) / whole;
      const double w = ((b - a).x() * (p - a).y() - (b - a).y() * (p - a).x()) / whole;
      if (u < -1e-6 || w < -1e-6 || u + w > 1 + 1e-6) continue;
      nearest = std::min(nearest, std::fabs(p.z() - (1 - u - w) * a.z() - u * b.z() - w * c.z()));
    }
    worst = std::max(worst, nearest);
  }
  EXPECT_LT(worst, 0.0005);
}

// Two sheets that meet in places but share no vertex: the seam stays closed.
TEST(CoarseMeshTest, SharedPlacesStay) {
  const Sheet one = MakeSheet(20, false, [](double x, double) { return 0.02 * std::sin(20 * x); });
  Sheet both = {Matrix(800, 3), Faces(2 * one.faces.rows(), 3)};
  Matrix mirrored = one.positions;
  mirrored.col(1) = -mirrored.col(1);  // meets the first in row 0
  both.positions << one.positions, mirrored;
  both.faces << one.faces, one.faces.array() + 400;
  const CoarseMesh mesh = MakeCoarseMesh(both.positions, both.faces, 400);
  ASSERT_EQ(mesh.vertices.size(), 400u);
  for (uint32_t v = 0; v < 20; ++v) {
    EXPECT_TRUE(std::binary_search(mesh.vertices.begin(), mesh.vertices.end(), v)) << v;
    EXPECT_TRUE(std::binary_search(mesh.vertices.begin(), mesh.vertices.end(), v + 400)) << v;
  }
}

TEST(CoarseMeshTest, EmptyWhereNothingMayGo) {
  Matrix positions(3, 3);
  positions << 0, 0, 0, 1, 0, 0, 0, 1, 0;
  Faces faces(1, 3);
  faces << 0, 1, 2;
  EXPECT_TRUE(MakeCoarseMesh(positions, faces, 1).empty());
  // No area, no plane: nothing is a number here, and nothing is merged on its account.
  positions.setZero();
  EXPECT_TRUE(MakeCoarseMesh(positions, faces, 1).empty());
}

}  // namespace
}  // namespace dcloth::converter
