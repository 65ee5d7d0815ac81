#include "converter/bundle.h"

#include <gtest/gtest.h>

#include <cstring>
#include <string>
#include <utility>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

TEST(BundleTest, ParentsMayBeAbsent) {
  RawFile raw = BuildBundle({});
  EXPECT_TRUE(ParseRawBundle(raw).parents.empty());
  raw.metadata["parents"] = "[1, -1, 1, -1, 2, 0]";
  EXPECT_EQ(ParseRawBundle(raw).parents, (std::vector<int32_t>{1, -1, 1, -1, 2, 0}));
}

TEST(BundleTest, StagesMayBeAbsent) {
  BundleSpec spec{.mesh = false};
  EXPECT_FALSE(ParseBundle(spec).mesh);
  EXPECT_TRUE(ParseBundle(spec).skeleton);
  spec.skeleton = false;
  EXPECT_FALSE(ParseBundle(spec).skeleton);
  RawFile nearest_alone = BuildBundle({});
  std::erase_if(nearest_alone.tensors, [](const auto& tensor) { return tensor.name.starts_with("mesh."); });
  EXPECT_FALSE(ParseRawBundle(nearest_alone).mesh);
  RawFile mesh_alone = BuildBundle({});
  std::erase_if(mesh_alone.tensors, [](const auto& tensor) { return tensor.name.starts_with("skeleton."); });
  EXPECT_TRUE(Mentions(Refusal(mesh_alone), "a mesh stage without a skeleton stage"));
}

TEST(BundleTest, ABasisMayComeAsFactors) {
  const BundleSpec spec{.skeleton_basis = 6};
  RawFile raw = BuildBundle(spec);
  raw.Erase("skeleton.basis");
  constexpr size_t kRank = 2;
  std::vector<float> readout(6 * kRank), components(kRank * 3 * spec.vertices);
  for (size_t i = 0; i < readout.size(); ++i) readout[i] = 0.25f * static_cast<float>(i) - 1;
  for (size_t i = 0; i < components.size(); ++i) components[i] = 0.01f * static_cast<float>(i % 7) + 0.001f;
  raw.Replace("skeleton.readout", {6, kRank}, readout);
  raw.Replace("skeleton.components", {kRank, spec.vertices, 3}, components);
  const Bundle bundle = ParseRawBundle(raw);
  ASSERT_EQ(bundle.skeleton->basis.rows(), 6);
  for (Eigen::Index i = 0; i < 6; ++i) {
    for (Eigen::Index c = 0; c < bundle.skeleton->basis.cols(); ++c) {
      const auto column = static_cast<size_t>(c), row = static_cast<size_t>(i);
      double expected = 0;
      for (size_t r = 0; r < kRank; ++r) {
        expected += double{readout[row * kRank + r]} * components[r * 3 * spec.vertices + column];
      }
      ASSERT_EQ(bundle.skeleton->basis(i, c), static_cast<float>(expected)) << i << " " << c;
    }
  }
  RawFile both = raw;
  both.Replace("skeleton.basis", {6, spec.vertices, 3}, std::vector<float>(18 * spec.vertices));
  EXPECT_TRUE(Mentions(Refusal(both), "skeleton.basis"));
  RawFile half = raw;
  half.Erase("skeleton.readout");
  EXPECT_TRUE(Mentions(Refusal(half), "skeleton.readout"));
  RawFile wide = raw;
  wide.Replace("skeleton.readout", {6, 7}, std::vector<float>(42));
  EXPECT_TRUE(Mentions(Refusal(wide), "7 components"));
  RawFile one = raw;  // component
  one.Replace("skeleton.readout", {6, 1}, std::vector<float>(6, 0.5f));
  one.Replace("skeleton.components", {1, spec.vertices, 3}, std::vector<float>(3 * spec.vertices, 0.25f));
  EXPECT_EQ(ParseRawBundle(one).skeleton->basis(5, 7), 0.125f);
  RawFile huge = raw;
  huge.SetFloat("skeleton.readout", 0, 3e38f);
  huge.SetFloat("skeleton.components", 0, 3e38f);
  EXPECT_TRUE(Mentions(Refusal(huge), "F32 cannot hold"));
}

TEST(BundleTest, HalfWeightsWidenAndHalfGeometryIsRefused) {
  const BundleSpec spec{.half_weights = true};
  RawFile raw = BuildBundle(spec);
  EXPECT_EQ(raw.At("mesh.basis").type, SafeType::kF16);
  EXPECT_EQ(Refusal(raw), "");
  auto& positions = raw.At("template.positions");
  positions.type = SafeType::kF16;
  positions.bytes.resize(positions.bytes.size() / 2);
  EXPECT_TRUE(Mentions(Refusal(raw), "template.positions", "dtype F16, expected F32"));
}

TEST(BundleTest, TheMarkIsZeroOrOne) {
  RawFile raw = BuildBundle({});
  raw.Replace("body.collides", {12}, std::vector<float>(12, 1.0f));
  EXPECT_EQ(ParseRawBundle(raw).body_collides, Vector::Ones(12));
  raw.SetFloat("body.collides", 0, 0);
  EXPECT_EQ(ParseRawBundle(raw).body_collides[0], 0);
  for (const size_t vertex : {11u, 7u, 0u}) {
    raw.SetFloat("body.collides", vertex, 0.5f);
    EXPECT_TRUE(Mentions(Refusal(raw), "body.collides", "0.5", "at vertex " + std::to_string(vertex), "else 0"));
  }
  raw.Replace("body.collides", {11}, std::vector<float>(11, 1.0f));
  EXPECT_TRUE(Mentions(Refusal(raw), "body.collides", "11", "12"));
}

TEST(BundleTest, TheSkinMayHaveColours) {
  RawFile raw = BuildBundle({});
  EXPECT_EQ(ParseRawBundle(raw).body_colours.size(), 0);
  raw.Replace("body.colours", {12, 3}, std::vector<float>(36, 0.25f));
  EXPECT_EQ(ParseRawBundle(raw).body_colours, Matrix::Constant(12, 3, 0.25f));
  for (const float wrong : {-0.01f, 1.01f}) {
    raw.SetFloat("body.colours", 35, wrong);
    EXPECT_TRUE(Mentions(Refusal(raw), "body.colours", "a number outside 0 to 1"));
  }
  raw.Replace("body.colours", {11, 3}, std::vector<float>(33, 0.25f));
  EXPECT_TRUE(Mentions(Refusal(raw), "body.colours", "11", "12"));
}

TEST(BundleTest, MasksAreReadBothOrNone) {
  RawFile raw = BuildBundle({});
  raw.SetMasks("body.parts", std::vector<int32_t>(12, 0x7FFFFFFF));
  EXPECT_TRUE(Mentions(Refusal(raw), "template.touches"));
  raw.SetMasks("template.touches", std::vector<int32_t>(60, 5));
  EXPECT_EQ(ParseRawBundle(raw).touches, std::vector<uint32_t>(60, 5));
  EXPECT_EQ(ParseRawBundle(raw).body_parts, std::vector<uint32_t>(12, 0x7FFFFFFF));
  raw.SetInt("template.touches", 0, INT32_MAX);
  EXPECT_EQ(ParseRawBundle(raw).touches[0], 0x7FFFFFFFu);
  raw.SetInt("template.touches", 59, -1);
  EXPECT_TRUE(Mentions(Refusal(raw), "template.touches", "-1 at vertex 59", "of 0 or more"));
  raw.SetInt("template.touches", 0, INT32_MIN);
  EXPECT_TRUE(Mentions(Refusal(raw), "template.touches", "-2147483648 at vertex 0"));
  raw.SetMasks("template.touches", std::vector<int32_t>(59, 5));
  EXPECT_TRUE(Mentions(Refusal(raw), "template.touches", "[59]", "[60]"));
  raw.Replace("template.touches", {60}, std::vector<float>(60, 1.0f));
  EXPECT_TRUE(Mentions(Refusal(raw), "template.touches", "F32", "I32"));
  raw.SetMasks("template.touches", std::vector<int32_t>(60, 5));
  raw.Erase("body.parts");
  EXPECT_TRUE(Mentions(Refusal(raw), "body.parts"));
}

// Element by element what the file holds, matrices in its order of rows.
TEST(BundleTest, EveryNumberIsTheFiles) {
  RawFile raw = BuildBundle({});
  const Bundle bundle = ParseRawBundle(raw);
  EXPECT_EQ(bundle.garment, "tube");
  EXPECT_EQ(bundle.tick_rate, 30);
  EXPECT_EQ(bundle.joint_names.size(), 6u);
  EXPECT_EQ(bundle.bones, (std::vector<uint32_t>{2, 3, 4, 5}));
  EXPECT_EQ(bundle.feature_joints, (std::vector<uint32_t>{0, 1, 2}));
  const SafeFile file = SafeFile::Parse(raw.Bytes(), "b");
  size_t compared = 0;
  const auto same = [&](const std::string& name, const auto& found) {
    const std::vector<float> expected = FloatsOf(file, file.Require(name));
    EXPECT_EQ(std::vector<float>(found.data(), found.data() + found.size()), expected) << name;
    ++compared;
  };
  const auto same_linear = [&](const std::string& name, const LinearWeights& found) {
    same(name + ".weight", found.weight);
    same(name + ".bias", found.bias);
  };
  same("template.positions", bundle.template_positions);
  same("body.positions", bundle.body_positions);
  same("body.joint_weights", bundle.body_joint_weights);
  same("features.mean", bundle.feature_mean);
  same("features.deviation", bundle.feature_deviation);
  same("features.low", bundle.feature_low);
  same("features.high", bundle.feature_high);
  same_linear("static.mlp.0", bundle.static_hidden);
  same_linear("static.mlp.2", bundle.static_increments);
  same("static.initial_weights", bundle.initial_weights);
  same("skeleton.gru.weight_ih", bundle.skeleton->input.weight);
  same("skeleton.gru.weight_hh", bundle.skeleton->hidden.weight);
  same("skeleton.gru.bias_ih", bundle.skeleton->input.bias);
  same("skeleton.gru.bias_hh", bundle.skeleton->hidden.bias);
  same("skeleton.basis", bundle.skeleton->basis);
  const MeshWeights& mesh = *bundle.mesh;
  same("nearest.points", mesh.nearest_points);
  same("nearest.joint_weights", mesh.nearest_joint_weights);
  same("mesh.input_mean", mesh.input_mean);
  same("mesh.input_deviation", mesh.input_deviation);
  for (size_t l = 0; l < 2; ++l) {
    const std::string name = "mesh.layers." + std::to_string(l) + ".";
    const MeshLayerWeights& layer = mesh.layers.at(l);
    same(name + "w_p", layer.w_p);
    same(name + "w_z", layer.w_z);
    same(name + "w_r", layer.w_r);
    same(name + "w", layer.w);
    same(name + "u_z", layer.u_z);
    same(name + "u_r", layer.u_r);
    same(name + "u", layer.u);
    same(name + "w_o", layer.w_o);
    same(name + "b", layer.b);
    same(name + "b_o", layer.b_o);
    same(name + "norm.weight", layer.norm_weight);
    same(name + "norm.bias", layer.norm_bias);
    EXPECT_EQ(layer.prelu, FloatsOf(file, file.Require(name + "prelu"))[0]);
  }
  same_linear("mesh.embed", mesh.embed);
  same_linear("mesh.mlp.0", mesh.hidden);
  same_linear("mesh.mlp.2", mesh.coefficients);
  same("mesh.basis", mesh.basis);
  // All but two slopes, two lists of faces and what follows.
  EXPECT_EQ(compared, raw.tensors.size() - 6);
  const std::vector<float> bind = FloatsOf(file, file.Require("character.bind"));
  ASSERT_EQ(bundle.bind.size(), 6u);
  for (size_t i = 0; i < bind.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i % 16 / 4), column = static_cast<Eigen::Index>(i % 4);
    EXPECT_EQ(bundle.bind.at(i / 16)(row, column), bind[i]);
  }
  const std::vector<float> residuals = FloatsOf(file, file.Require("static.residual_weights"));
  const size_t each = residuals.size() / 2;
  for (size_t i = 0; i < residuals.size(); ++i) {
    EXPECT_EQ(bundle.residual_weights.at(i / each).data()[i % each], residuals[i]);
  }
  for (const auto& [name, faces] : {std::pair<const char*, const Faces*>{"template.faces", &bundle.template_faces},
                                    {"body.faces", &bundle.body_faces}}) {
    const RawTensor& tensor = raw.At(name);
    ASSERT_EQ(static_cast<size_t>(faces->size()) * 4, tensor.bytes.size());
    EXPECT_EQ(std::memcmp(faces->data(), tensor.bytes.data(), tensor.bytes.size()), 0) << name;
  }
}

}  // namespace
}  // namespace dcloth::converter
