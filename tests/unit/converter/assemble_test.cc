#include "converter/assemble.h"

#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <map>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

template <typename Number>
std::vector<Number> Numbers(const PackedTensor& tensor) {
  std::vector<Number> numbers(tensor.bytes.size() / sizeof(Number));
  std::memcpy(numbers.data(), tensor.bytes.data(), tensor.bytes.size());
  return numbers;
}

ModelParts Parts(const Bundle& bundle, Precision precision = Precision::kFp32) {
  return Assemble(bundle, FoldBundle(bundle, 8, 8), {precision, {}});
}

TEST(AssembleTest, EachMatrixHasItsFormats) {
  constexpr Precision kFp32 = Precision::kFp32, kFp16 = Precision::kFp16, kInt8 = Precision::kInt8;
  // What fp32, fp16 and int8 make of each.
  const std::map<std::string, std::array<Precision, 3>> formats = {
      {"static_stage.hidden", {kFp32, kFp16, kFp16}},  {"static_stage.increments", {kFp32, kFp16, kFp16}},
      {"skeleton_stage.input", {kFp32, kFp16, kInt8}}, {"skeleton_stage.hidden", {kFp32, kFp16, kInt8}},
      {"displacement.basis", {kFp32, kFp16, kInt8}},   {"displacement.head", {kFp32, kFp16, kFp16}},
      {"mesh_stage.hidden", {kFp32, kFp16, kInt8}},    {"mesh_stage.coefficients", {kFp32, kFp16, kInt8}},
      {"mesh_stage.layers.0", {kFp32, kFp32, kInt8}},  {"mesh_stage.layers.7", {kFp32, kFp32, kInt8}},
  };
  for (const auto& [matrix, expected] : formats) {
    for (const Precision asked : {kFp32, kFp16, kInt8}) {
      const Precision stored = expected[static_cast<size_t>(asked)];
      EXPECT_EQ(FormatOf({asked, {}}, matrix), stored) << matrix;
      for (const auto& [other, unused] : formats) {
        EXPECT_EQ(FormatOf({asked, other + ".weights"}, matrix), other == matrix ? stored : kFp32) << matrix;
        EXPECT_EQ(FormatOf({kFp32, "", {{other + ".weights", asked}}}, matrix), other == matrix ? stored : kFp32);
      }
    }
  }
}

TEST(AssembleTest, GraphLayersOfSixteenFeaturesAndMoreAreIntegers) {
  BundleSpec spec;
  for (const uint32_t width : {8u, 16u, 24u}) {
    spec.feature_width = width;
    for (const Precision precision : kPrecisions) {
      const ModelParts parts = Parts(ParseBundle(spec), precision);
      ASSERT_EQ(parts.mesh->layers.size(), 2u);
      EXPECT_EQ(parts.mesh->feature_width, width);
      for (const MeshLayerParts& layer : parts.mesh->layers) {
        EXPECT_EQ(layer.weights.has_value(), precision == Precision::kInt8 && width >= 16) << width;
        EXPECT_NE(layer.weights.has_value(), layer.output.has_value());
      }
    }
  }
}

TEST(AssembleTest, EmbeddingIsTheBundles) {
  const Bundle bundle = ParseBundle({});
  const ModelParts parts = Parts(bundle);
  const std::vector<float> embed = Numbers<float>(parts.mesh->embed);
  ASSERT_EQ(embed.size(), 8u);
  for (size_t i = 0; i < 8; ++i) EXPECT_EQ(embed[i], bundle.mesh->embed.weight(0, static_cast<Eigen::Index>(i)));
  EXPECT_EQ(parts.mesh->embed_bias, bundle.mesh->embed.bias[0]);
  EXPECT_NE(parts.mesh->embed_bias, 0);
}

// Back from the parts to the bundle's skin: vertex by vertex, joints by their names, faces in their order.
TEST(AssembleTest, BodyIsTheBundles) {
  const BundleSpec spec{.joints = 9, .body_vertices = 70};
  for (const bool classes : {false, true}) {
    Bundle bundle = ParseBundle(spec);
    bundle.body_collides = Vector::Ones(70);
    for (Eigen::Index i = 0; i < 70; i += 9) bundle.body_collides[i] = 0;
    bundle.body_joint_weights.col(1).setZero();  // a joint that no one needs: numbers of later ones move
    if (classes) {
      for (uint32_t i = 0; i < 60; ++i) bundle.touches.push_back(i % 2 == 0 ? 5 : 6);
      for (uint32_t i = 0; i < 70; ++i) bundle.body_parts.push_back(i < 35 ? 1 : 7);
    }
    const FoldedBundle folded = FoldBundle(bundle, 8, 8);
    const ModelParts parts = Assemble(bundle, folded, {});
    ASSERT_TRUE(parts.body);
    const BodyParts& body = *parts.body;
    const std::vector<uint32_t>& vertices = folded.surface.vertices;
    const size_t b = vertices.size(), influences = body.influences;
    ASSERT_GT(b, 32u);
    const auto positions = Numbers<float>(body.positions), weights = Numbers<float>(body.weights);
    const auto joints = Numbers<uint8_t>(body.joints);
    const auto faces = Numbers<uint16_t>(body.faces), columns = Numbers<uint16_t>(body.columns);
    ASSERT_EQ(positions.size(), 3 * b);
    ASSERT_EQ(joints.size(), influences * b);
    ASSERT_EQ(weights.size(), influences * b);
    for (size_t i = 0; i < b; ++i) {
      const auto row = static_cast<Eigen::Index>(vertices[i]);
      for (size_t axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(positions[3 * i + axis], bundle.body_positions(row, static_cast<Eigen::Index>(axis))) << i;
      }
      std::map<std::string, double> found;
      for (size_t k = i * influences; k < (i + 1) * influences; ++k) {
        found[parts.joint_names.at(joints[k])] += static_cast<double>(weights[k]);
      }
      const Eigen::RowVectorXd dense = bundle.body_joint_weights.row(row).cast<double>();
      for (size_t j = 0; j < 9; ++j) {
        EXPECT_NEAR(found[bundle.joint_names[j]], dense[static_cast<Eigen::Index>(j)] / dense.sum(), 8 * 0x1p-24);
      }
    }
    EXPECT_EQ(faces, std::vector<uint16_t>(folded.surface.faces.begin(), folded.surface.faces.end()));
    EXPECT_EQ(columns, std::vector<uint16_t>(folded.surface.columns.begin(), folded.surface.columns.end()));
    EXPECT_EQ(Numbers<uint32_t>(body.row_starts), folded.surface.row_starts);
    EXPECT_EQ(body.touch_classes.has_value(), classes);
    EXPECT_EQ(body.touched_by.has_value(), classes);
    if (!classes) continue;
    EXPECT_EQ(Numbers<uint8_t>(*body.touch_classes), folded.surface.touch_classes);
    EXPECT_EQ(Numbers<uint8_t>(*body.touched_by), folded.surface.touched_by);
  }
}

}  // namespace
}  // namespace dcloth::converter
