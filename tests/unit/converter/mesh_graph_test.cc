#include "converter/mesh_graph.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

TEST(MeshGraphTest, TwoTrianglesAndAVertexAlone) {
  Faces faces(2, 3);
  faces << 0, 1, 2, 2, 1, 3;
  const MeshGraph graph = BuildMeshGraph(faces, 5);
  EXPECT_EQ(graph.row_starts, (std::vector<uint32_t>{0, 3, 7, 11, 14, 15}));
  EXPECT_EQ(graph.columns, (std::vector<uint16_t>{0, 1, 2, 0, 1, 2, 3, 0, 1, 2, 3, 1, 2, 3, 4}));
}

TEST(MeshGraphTest, AgreesWithSetsOnATube) {
  const BundleSpec spec{.vertices = 997};
  const Bundle bundle = ParseBundle(spec);
  std::vector<std::set<int>> neighbours(spec.vertices);
  for (int i = 0; i < static_cast<int>(spec.vertices); ++i) neighbours[static_cast<size_t>(i)].insert(i);
  for (Eigen::Index face = 0; face < bundle.template_faces.rows(); ++face) {
    for (const int a : bundle.template_faces.row(face)) {
      for (const int b : bundle.template_faces.row(face)) neighbours[static_cast<size_t>(a)].insert(b);
    }
  }
  const MeshGraph graph = BuildMeshGraph(bundle.template_faces, spec.vertices);
  ASSERT_EQ(graph.row_starts.size(), spec.vertices + 1);
  for (size_t i = 0; i < spec.vertices; ++i) {
    const std::vector<int> row(graph.columns.begin() + graph.row_starts[i],
                               graph.columns.begin() + graph.row_starts[i + 1]);
    ASSERT_EQ(row, std::vector<int>(neighbours[i].begin(), neighbours[i].end())) << i;
  }
  EXPECT_EQ(graph.row_starts.back(), graph.columns.size());
}

TEST(MeshGraphTest, HighestIndicesFit) {
  Faces faces(1, 3);
  faces << 65534, 65533, 0;
  const MeshGraph graph = BuildMeshGraph(faces, 65535);
  EXPECT_EQ(graph.columns.back(), 65534);
  EXPECT_EQ(graph.row_starts[65535] - graph.row_starts[65534], 3u);
}

}  // namespace
}  // namespace dcloth::converter
