#include "converter/texture_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>
#include <tuple>

#include "converter/convert.h"
#include "converter/error.h"
#include "converter/rollout.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

// A bundle of the builder's whose corners lie at `place(corner, vertex)`.
template <typename Place>
RawFile Textured(const BundleSpec& spec, const Place& place) {
  RawFile raw = BuildBundle(spec);
  const Bundle plain = ParseRawBundle(raw);
  std::vector<float> corners;
  for (Eigen::Index i = 0; i < plain.template_faces.size(); ++i) {
    const auto [u, v] = place(i, plain.template_faces.data()[i]);
    corners.insert(corners.end(), {u, v});
  }
  raw.Replace("template.texture_coordinates", {static_cast<uint64_t>(plain.template_faces.rows()), 3, 2}, corners);
  return raw;
}

// What a mesh shows of each corner: a vertex of the garment and its place.
std::vector<std::tuple<uint32_t, float, float>> Corners(const TextureMesh& mesh, uint32_t n) {
  std::vector<std::tuple<uint32_t, float, float>> corners;
  for (const uint32_t drawn : mesh.faces) {
    const uint32_t vertex = drawn < n ? drawn : mesh.seam_vertices.at(drawn - n);
    corners.emplace_back(vertex, mesh.coordinates(drawn, 0), mesh.coordinates(drawn, 1));
  }
  return corners;
}

TEST(TextureMeshTest, NothingComesOfNothing) {
  const Bundle bundle = ParseBundle({});
  EXPECT_TRUE(MakeTextureMesh(bundle).empty());
  EXPECT_EQ(OpenModel(Convert(bundle, {}).bytes).info().textured_vertex_count, 0u);
}

TEST(TextureMeshTest, WithoutSeamsItIsTheGarment) {
  const auto raw = Textured({}, [](Eigen::Index, int vertex) {
    return std::pair(0.01f * static_cast<float>(vertex), 1 - 0.02f * static_cast<float>(vertex));
  });
  const Bundle bundle = ParseRawBundle(raw);
  const TextureMesh mesh = MakeTextureMesh(bundle);
  EXPECT_TRUE(mesh.seam_vertices.empty());
  EXPECT_TRUE(std::equal(mesh.faces.begin(), mesh.faces.end(), bundle.template_faces.data(),
                         bundle.template_faces.data() + bundle.template_faces.size()));
  const OpenModel model(Convert(bundle, {}).bytes);
  const dcloth_model_info info = model.info();
  ASSERT_EQ(info.textured_vertex_count, info.vertex_count);
  EXPECT_EQ(info.seam_vertices, nullptr);
  EXPECT_EQ(info.textured_triangles, info.triangles);
  EXPECT_EQ(info.format_minor, 7u);
  for (uint32_t v = 0; v < info.vertex_count; ++v) {
    EXPECT_EQ(info.texture_coordinates[2 * v], 0.01f * static_cast<float>(v));
    EXPECT_EQ(info.texture_coordinates[2 * v + 1], 1 - 0.02f * static_cast<float>(v));
  }
}

// Each corner keeps its vertex and its place, no vertex is drawn twice at one place, and the garment's come first.
TEST(TextureMeshTest, RepeatsAVertexForEachFurtherPlace) {
  std::mt19937 random(3);
  for (const int places : {2, 3, 50}) {
    const auto raw = Textured({}, [&](Eigen::Index, int vertex) {
      return std::pair(static_cast<float>(random() % static_cast<unsigned>(places)), static_cast<float>(vertex % 7));
    });
    const Bundle bundle = ParseRawBundle(raw);
    const uint32_t n = bundle.vertex_count();
    const TextureMesh mesh = MakeTextureMesh(bundle);
    ASSERT_EQ(static_cast<size_t>(mesh.coordinates.rows()), n + mesh.seam_vertices.size());
    const auto corners = Corners(mesh, n);
    std::set<std::tuple<uint32_t, float, float>> distinct;
    for (size_t i = 0; i < corners.size(); ++i) {
      const auto row = static_cast<Eigen::Index>(i);
      const std::tuple<uint32_t, float, float> expected = {static_cast<uint32_t>(bundle.template_faces.data()[row]),
                                                           bundle.texture_coordinates(row, 0),
                                                           bundle.texture_coordinates(row, 1)};
      ASSERT_EQ(corners[i], expected) << i;
      distinct.insert(expected);
    }
    std::set<uint32_t> used(mesh.faces.begin(), mesh.faces.end());
    EXPECT_EQ(used.size(), distinct.size());
    EXPECT_GT(mesh.seam_vertices.size(), 0u);
    const OpenModel model(Convert(bundle, {}).bytes);
    EXPECT_EQ(model.info().textured_vertex_count, n + mesh.seam_vertices.size());
    EXPECT_EQ(model.info().seam_vertex_count, mesh.seam_vertices.size());
    EXPECT_TRUE(std::equal(mesh.seam_vertices.begin(), mesh.seam_vertices.end(), model.info().seam_vertices));
    EXPECT_TRUE(std::equal(mesh.faces.begin(), mesh.faces.end(), model.info().textured_triangles));
  }
}

TEST(TextureMeshTest, RefusesMoreVerticesThanIndicesReach) {
  const BundleSpec spec{.vertices = 12000, .skeleton = false, .mesh = false};
  const auto raw = Textured(spec, [](Eigen::Index corner, int) { return std::pair(static_cast<float>(corner), 0.0f); });
  const Bundle bundle = ParseRawBundle(raw);
  try {
    MakeTextureMesh(bundle);
    FAIL() << bundle.template_faces.size();
  } catch (const Error& error) {
    const std::string text = error.what();
    EXPECT_NE(text.find("template.texture_coordinates"), std::string::npos) << text;
    EXPECT_NE(text.find("expected at most 65535"), std::string::npos) << text;
  }
}

TEST(TextureMeshTest, ABundleHasAPlaceForEveryCorner) {
  auto raw = Textured({}, [](Eigen::Index, int) { return std::pair(0.5f, 0.5f); });
  raw.SetFloat("template.texture_coordinates", 4, NAN);
  EXPECT_THROW(ParseRawBundle(raw), Error);
  raw.Replace("template.texture_coordinates", {60, 2}, std::vector<float>(120));
  EXPECT_THROW(ParseRawBundle(raw), Error);
}

}  // namespace
}  // namespace dcloth::converter
