#include "converter/bundle.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <string>
#include <utility>

#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BuildBundle;
using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;
using dcloth::testing::ParseBundle;
using dcloth::testing::ParseRawBundle;
using dcloth::testing::RawFile;
using dcloth::testing::RawTensor;

std::string Refusal(const RawFile& raw) {
  return ErrorText([&] { ParseRawBundle(raw); });
}

TEST(BundleTest, ReadsEveryField) {
  BundleSpec spec;
  const RawFile raw = BuildBundle(spec);
  const Bundle bundle = ParseRawBundle(raw);
  EXPECT_EQ(bundle.garment, "tube");
  EXPECT_EQ(bundle.tick_rate, 30);
  EXPECT_EQ(bundle.vertex_count(), spec.vertices);
  EXPECT_EQ(bundle.feature_count(), spec.features());
  EXPECT_EQ(bundle.joint_names.size(), spec.joints);
  EXPECT_EQ(bundle.bones, (std::vector<uint32_t>{2, 3, 4, 5}));
  EXPECT_EQ(bundle.feature_joints, (std::vector<uint32_t>{0, 1, 2}));
  EXPECT_EQ(bundle.residual_weights.size(), spec.residuals);
  ASSERT_TRUE(bundle.skeleton && bundle.mesh);
  EXPECT_EQ(bundle.skeleton->basis.rows(), spec.skeleton_basis);
  EXPECT_EQ(bundle.skeleton->basis.cols(), 3 * spec.vertices);
  EXPECT_EQ(bundle.mesh->layers.size(), spec.layers);
  // The last number of a tensor lands at the end of the matrix: nothing is transposed.
  const SafeFile file = SafeFile::Parse(raw.Bytes(), "b");
  const std::vector<float> basis = FloatsOf(file, file.Require("mesh.basis"));
  EXPECT_EQ(bundle.mesh->basis(6, 3 * spec.vertices - 1), basis.back());
  EXPECT_EQ(bundle.mesh->basis(0, 1), basis[1]);
}

TEST(BundleTest, StagesMayBeAbsent) {
  BundleSpec spec;
  spec.mesh = false;
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
  RawFile huge = raw;
  huge.SetFloat("skeleton.readout", 0, 3e38f);
  huge.SetFloat("skeleton.components", 0, 3e38f);
  EXPECT_TRUE(Mentions(Refusal(huge), "beyond F32"));
}

TEST(BundleTest, HalfWeightsWidenAndHalfGeometryIsRefused) {
  BundleSpec spec;
  spec.half_weights = true;
  RawFile raw = BuildBundle(spec);
  EXPECT_EQ(raw.At("mesh.basis").type, SafeType::kF16);
  EXPECT_EQ(Refusal(raw), "");
  auto& positions = raw.At("template.positions");
  positions.type = SafeType::kF16;
  positions.bytes.resize(positions.bytes.size() / 2);
  EXPECT_TRUE(Mentions(Refusal(raw), "template.positions", "dtype F16, expected F32"));
}

// Missing one tensor at a time: the name is in the message. A group's absence is legal only as a whole.
TEST(BundleTest, EachMissingTensorIsNamed) {
  const RawFile whole = BuildBundle({});
  ASSERT_GT(whole.tensors.size(), 50u);
  for (const auto& tensor : whole.tensors) {
    RawFile raw = whole;
    raw.Erase(tensor.name);
    EXPECT_TRUE(Mentions(Refusal(raw), "tensor " + tensor.name + ": found no such tensor")) << tensor.name;
  }
}

// One extent more in each dimension of each tensor: the shape found is in the message. Where a tensor defines a size,
// the first one that depends on it may be the one named.
TEST(BundleTest, EachWrongShapeIsRefused) {
  const RawFile whole = BuildBundle({});
  size_t named = 0, tried = 0;
  for (const auto& tensor : whole.tensors) {
    for (size_t dimension = 0; dimension <= tensor.shape.size(); ++dimension) {
      RawFile raw = whole;
      auto& changed = raw.At(tensor.name);
      const size_t count = changed.bytes.size() / SafeTypeSize(changed.type);
      if (dimension < tensor.shape.size()) {
        const uint64_t extent = changed.shape[dimension]++;
        changed.bytes.resize(count / extent * (extent + 1) * SafeTypeSize(changed.type));
      } else {
        changed.shape.push_back(1);
      }
      // More body vertices than faces use, more residual matrices of zeros and more faces of zeros are no wrong shapes
      // by themselves: body.faces and template.faces fail on their content, residuals are good.
      if (tensor.name == "static.residual_weights" && dimension == 0) continue;
      const std::string text = Refusal(raw);
      ASSERT_FALSE(text.empty()) << tensor.name << " dimension " << dimension;
      ++tried;
      named += text.find(ShapeText(changed.shape)) != std::string::npos ? 1 : 0;
    }
  }
  EXPECT_GT(tried, 100u);
  EXPECT_GT(named, tried * 9 / 10);
}

TEST(BundleTest, EachWrongDtypeIsRefused) {
  const RawFile whole = BuildBundle({});
  for (const auto& tensor : whole.tensors) {
    RawFile raw = whole;
    auto& changed = raw.At(tensor.name);
    changed.type = changed.type == SafeType::kI32 ? SafeType::kU32 : SafeType::kI32;
    EXPECT_TRUE(Mentions(Refusal(raw), tensor.name, "dtype")) << tensor.name;
  }
}

TEST(BundleTest, NanAndInfinityAnywhereAreRefused) {
  const RawFile whole = BuildBundle({});
  for (const auto& tensor : whole.tensors) {
    if (tensor.type != SafeType::kF32) continue;
    const size_t last = tensor.bytes.size() / 4 - 1;
    for (const float value : {NAN, INFINITY, -INFINITY}) {
      RawFile raw = whole;
      raw.SetFloat(tensor.name, last, value);
      EXPECT_TRUE(Mentions(Refusal(raw), tensor.name, "at element " + std::to_string(last))) << tensor.name;
    }
  }
}

TEST(BundleTest, EveryTruncatedPrefixIsRefused) {
  BundleSpec spec;
  spec.vertices = 12;
  spec.joints = 3;
  spec.feature_joints = 1;
  spec.bones = 2;
  spec.body_vertices = 3;
  spec.static_width = spec.skeleton_basis = spec.mesh_basis = spec.mesh_width = 2;
  spec.layers = 1;
  const AlignedBytes whole = BuildBundle(spec).Bytes();
  ASSERT_EQ(ErrorText([&] { BundleFrom(SafeFile::Parse(whole, "b")); }), "");
  for (size_t size = 0; size < whole.size(); ++size) {
    AlignedBytes prefix(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    ASSERT_TRUE(Mentions(ErrorText([&] { BundleFrom(SafeFile::Parse(std::move(prefix), "b")); }), "b: ")) << size;
  }
}

struct Fault {
  const char* name;
  std::function<void(RawFile*)> make;
  const char* tensor;
  const char* found;
};

class BundleFaultTest : public ::testing::TestWithParam<Fault> {};

TEST_P(BundleFaultTest, IsRefused) {
  RawFile raw = BuildBundle({});
  ASSERT_EQ(Refusal(raw), "");
  GetParam().make(&raw);
  EXPECT_TRUE(Mentions(Refusal(raw), "b.safetensors", GetParam().tensor, GetParam().found));
}

Fault Meta(const char* name, const char* key, const char* value, const char* found) {
  return {name, [=](RawFile* raw) { raw->metadata[key] = value; }, key, found};
}

const Fault kFaults[] = {
    {"Unknown", [](RawFile* raw) { raw->Replace("mesh.layer.0.b", {1}, {0}); }, "mesh.layer.0.b", "does not have"},
    {"FaceTooHigh", [](RawFile* raw) { raw->SetInt("template.faces", 4, 60); }, "template.faces",
     "vertex 60 in face 1"},
    {"FaceNegative", [](RawFile* raw) { raw->SetInt("body.faces", 0, -1); }, "body.faces", "vertex -1 in face 0"},
    {"FaceDegenerate", [](RawFile* raw) { raw->SetInt("template.faces", 1, 0); }, "template.faces",
     "a vertex twice in face 0"},
    {"RowSum", [](RawFile* raw) { raw->SetFloat("body.joint_weights", 0, 0.9f); }, "body.joint_weights", "in row 0"},
    {"NegativeWeight", [](RawFile* raw) { raw->SetFloat("nearest.joint_weights", 7, -0.1f); }, "nearest.joint_weights",
     "negative"},
    {"ZeroDeviation", [](RawFile* raw) { raw->SetFloat("features.deviation", 2, 0); }, "features.deviation",
     "at element 2"},
    {"NegativeDeviation", [](RawFile* raw) { raw->SetFloat("mesh.input_deviation", 1, -1); }, "mesh.input_deviation",
     "at element 1"},
    {"LowAboveHigh", [](RawFile* raw) { raw->SetFloat("features.low", 3, 9); }, "features.low",
     "above features.high at element 3"},
    {"SingularBind",
     [](RawFile* raw) {
       for (size_t i = 0; i < 12; ++i) raw->SetFloat("character.bind", i, 0);
     },
     "character.bind", "without inverse in joint 'joint_0'"},
    {"TransposedBind", [](RawFile* raw) { raw->SetFloat("character.bind", 12, 0.5f); }, "character.bind", "0 0 0 1"},
    Meta("Format", "format", "onnx", "'onnx'"),
    Meta("Version", "format_version", "2", "'2'"),
    Meta("NoName", "garment", "", "an empty garment name"),
    Meta("TickRateZero", "tick_rate", "0", "'0'"),
    Meta("TickRateText", "tick_rate", "30fps", "'30fps'"),
    Meta("TickRateNan", "tick_rate", "nan", "'nan'"),
    Meta("TickRateHuge", "tick_rate", "1e9", "'1e9'"),
    Meta("TickRateAboveTheLimit", "tick_rate", "1000.001", "'1000.001', expected a number above 0, at most 1000"),
    Meta("TickRateNegative", "tick_rate", "-30", "'-30'"),
    Meta("TickRateEmpty", "tick_rate", "", "''"),
    Meta("HipsUnknown", "hips", "pelvis", "'pelvis'"),
    Meta("JointTwice", "joint_names", R"(["a","b","a","c","d","e"])", "'a' twice"),
    Meta("JointEmpty", "joint_names", R"(["a","","b","c","d","e"])", "an empty name"),
    Meta("JointNotText", "joint_names", "[1]", "a JSON list"),
    Meta("JointsNone", "joint_names", "[]", "a JSON list"),
    Meta("JointsNoJson", "joint_names", "[\"a\"", "a JSON list"),
    Meta("BoneUnknown", "bones", R"(["joint_0","tail"])", "'tail'"),
    Meta("BoneTwice", "bones", R"(["joint_0","joint_0"])", "twice"),
    Meta("FeatureUnknown", "feature_joints", R"(["tail"])", "'tail'"),
    Meta("RootMotion", "root_motion", "yes", "'yes'"),
    Meta("Training", "training", "[]", "'[]'"),
    Meta("JointsText", "joint_names", R"("abcdef")", "a JSON list"),
    Meta("JointsObject", "joint_names", R"({"a":"b"})", "a JSON list"),
    Meta("JointZeroByte", "joint_names", R"(["a\u0000b","b","c","d","e","f"])", "one that holds a zero byte"),
    {"NameZeroByte", [](RawFile* raw) { raw->metadata["garment"].append("\0x", 2); }, "expected a plain name",
     "one with a zero byte"},
    {"ZeroByte", [](RawFile* raw) { raw->metadata["bones"].append("\0x", 2); }, "bones", "a JSON list"},
};
INSTANTIATE_TEST_SUITE_P(Bundle, BundleFaultTest, ::testing::ValuesIn(kFaults),
                         [](const auto& test) { return std::string(test.param.name); });

// A determinant of 1e-9 is the least: in three floats that add up to it to the last of a double's bits, and one bit below.
TEST(BundleTest, TheLeastDeterminantOfABindMatrixIsTaken) {
  const auto with_determinant = [](double determinant) {
    const auto high = static_cast<float>(determinant);
    const auto middle = static_cast<float>(determinant - static_cast<double>(high));
    const double rest = determinant - static_cast<double>(high) - static_cast<double>(middle);
    const auto low = static_cast<float>(rest);
    EXPECT_EQ(static_cast<double>(low), rest);
    RawFile raw = BuildBundle({});
    const float rows[16] = {1, low, 0, 0, -1, high, middle, 0, 0, -1, 1, 0, 0, 0, 0, 1};
    for (size_t i = 0; i < 16; ++i) raw.SetFloat("character.bind", i, rows[i]);
    return raw;
  };
  EXPECT_EQ(ParseRawBundle(with_determinant(1e-9)).bind[0](1, 0), -1);
  EXPECT_EQ(ParseRawBundle(with_determinant(-1e-9)).bind[0](1, 0), -1);
  EXPECT_TRUE(Mentions(Refusal(with_determinant(std::nextafter(1e-9, 0))), "without inverse in joint 'joint_0'"));
}

TEST(BundleTest, OddMetadataAreTaken) {
  RawFile raw = BuildBundle({.root_motion = false});
  EXPECT_EQ(ParseRawBundle(raw).feature_count(), 27u);
  EXPECT_FALSE(ParseRawBundle(raw).root_motion);
  raw.metadata["garment"] = "a\1b";
  EXPECT_EQ(ParseRawBundle(raw).garment, "a\1b");
  for (const auto& [text, rate] : {std::pair("1000", 1000.0), {"0.25", 0.25}, {"1", 1.0}}) {
    raw.metadata["tick_rate"] = text;
    EXPECT_EQ(ParseRawBundle(raw).tick_rate, rate);
  }
  // Objects in objects: 32 deep and one more.
  const auto nested = [](size_t depth) {
    std::string text = "1";
    for (size_t i = 0; i < depth; ++i) text = R"({"a":)" + text + "}";
    return text;
  };
  raw.metadata["training"] = nested(32);
  EXPECT_EQ(ParseRawBundle(raw).training, nested(32));
  raw.metadata["training"] = nested(33);
  EXPECT_TRUE(Mentions(Refusal(raw), "metadata 'training'", "a JSON object"));
  raw.metadata.erase("training");
  EXPECT_EQ(ParseRawBundle(raw).training, "{}");
}

TEST(BundleTest, EachMissingMetadatumIsNamed) {
  const RawFile whole = BuildBundle({});
  for (const auto& [key, value] : whole.metadata) {
    if (key == "training") continue;  // free
    RawFile raw = whole;
    raw.metadata.erase(key);
    EXPECT_TRUE(Mentions(Refusal(raw), "no metadata '" + key + "'"));
  }
  RawFile deep = whole;
  deep.metadata["training"] = std::string(1 << 20, '[');
  EXPECT_TRUE(Mentions(Refusal(deep), "metadata 'training'"));
}

TEST(BundleTest, TheMarkIsZeroOrOne) {
  RawFile raw = BuildBundle({});
  raw.Replace("body.collides", {12}, std::vector<float>(12, 1.0f));
  EXPECT_EQ(ParseRawBundle(raw).body_collides, Vector::Ones(12));
  raw.SetFloat("body.collides", 0, 0);
  EXPECT_EQ(ParseRawBundle(raw).body_collides[0], 0);
  for (const size_t vertex : {11u, 7u, 0u}) {
    raw.SetFloat("body.collides", vertex, 0.5f);
    EXPECT_TRUE(Mentions(Refusal(raw), "body.collides", "0.5", "at vertex " + std::to_string(vertex), "0 elsewhere"));
  }
  raw.Replace("body.collides", {11}, std::vector<float>(11, 1.0f));
  EXPECT_TRUE(Mentions(Refusal(raw), "body.collides", "11", "12"));
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
  EXPECT_TRUE(Mentions(Refusal(raw), "template.touches", "-1 at vertex 59", "from 0 up"));
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

// A triangle is the least garment; no residual matrix is needed.
TEST(BundleTest, LeastAndMostVerticesAreTaken) {
  const auto refusal = [](uint32_t vertices) {
    RawFile raw = BuildBundle({.vertices = vertices, .bones = 1, .residuals = 0, .skeleton = false, .mesh = false});
    RawTensor& faces = raw.At("template.faces");
    faces.shape = {1, 3};
    faces.bytes.assign(12, std::byte{0});
    raw.SetInt("template.faces", 1, 1);
    raw.SetInt("template.faces", 2, static_cast<int32_t>(vertices) - 1);
    return Refusal(raw);
  };
  EXPECT_TRUE(Mentions(refusal(2), "template.positions", "found 2 vertices, expected 3 to 65535"));
  EXPECT_EQ(refusal(3), "");
  EXPECT_EQ(refusal(65535), "");
  EXPECT_TRUE(Mentions(refusal(65536), "template.positions", "found 65536 vertices"));
}

TEST(BundleTest, EachNumberOfALastRowOfABindMatrixCounts) {
  for (size_t i = 12; i < 16; ++i) {
    for (const float value : {0.0f, 1.0f, 0.5f}) {
      RawFile raw = BuildBundle({});
      raw.SetFloat("character.bind", 16 + i, value);
      const std::string text = Refusal(raw);
      if (value == (i == 15 ? 1.0f : 0.0f)) {
        EXPECT_EQ(text, "");
      } else {
        EXPECT_TRUE(Mentions(text, "character.bind", "another last row than 0 0 0 1 in joint 'joint_1'")) << i;
      }
    }
  }
}

TEST(BundleTest, LimitsThemselvesAreTaken) {
  RawFile raw = BuildBundle({});
  const float low = ParseRawBundle(raw).feature_low[0];
  raw.SetFloat("features.high", 0, low);
  EXPECT_EQ(Refusal(raw), "");
  raw.SetFloat("features.high", 0, std::nextafter(low, -INFINITY));
  EXPECT_TRUE(Mentions(Refusal(raw), "features.low", "above features.high at element 0"));

  const std::pair<float, bool> deviations[] = {
      {1e-30f, true}, {std::nextafter(1e-30f, 0.0f), false}, {1e30f, true}, {std::nextafter(1e30f, INFINITY), false}};
  for (const auto& [value, good] : deviations) {
    raw = BuildBundle({});
    raw.SetFloat("features.deviation", 0, value);
    EXPECT_EQ(Refusal(raw).empty(), good) << value;
  }

  // As many components as rows.
  const BundleSpec spec{.skeleton_basis = 2};
  raw = BuildBundle(spec);
  raw.Erase("skeleton.basis");
  raw.Replace("skeleton.readout", {2, 2}, {1, 0, 0, 1});
  raw.Replace("skeleton.components", {2, spec.vertices, 3}, std::vector<float>(6 * spec.vertices, 0.5f));
  EXPECT_EQ(ParseRawBundle(raw).skeleton->basis, Matrix::Constant(2, 3 * spec.vertices, 0.5f));

  // Where a unit's three gates end.
  for (const uint64_t rows : {uint64_t{1}, uint64_t{2}, uint64_t{29}, uint64_t{31}}) {
    raw = BuildBundle({});
    raw.Replace("skeleton.gru.bias_hh", {rows}, std::vector<float>(rows));
    EXPECT_TRUE(Mentions(Refusal(raw), "skeleton.gru.bias_hh", "found " + std::to_string(rows) + " values"));
  }
}

TEST(BundleTest, ExtentsEndAt16777216) {
  for (const bool more : {false, true}) {
    RawFile raw = BuildBundle({});
    RawTensor& bias = raw.At("skeleton.gru.bias_hh");
    bias.type = SafeType::kF16;
    bias.shape = {(uint64_t{1} << 24) + (more ? 1 : 0)};
    bias.bytes.assign(2 * bias.shape[0], std::byte{0});
    EXPECT_TRUE(Mentions(Refusal(raw), "skeleton.gru.bias_hh", more ? "shape [16777217]" : "16777216 values"));
  }
}

TEST(BundleTest, SkinWeightsSumToOneAndMayBeZero) {
  const auto refusal = [](size_t row, float first, float second) {
    RawFile raw = BuildBundle({});
    for (size_t j = 0; j < 6; ++j) raw.SetFloat("body.joint_weights", 6 * row + j, 0);
    raw.SetFloat("body.joint_weights", 6 * row, first);
    raw.SetFloat("body.joint_weights", 6 * row + 1, second);
    return Refusal(raw);
  };
  for (const size_t row : {size_t{0}, size_t{5}, size_t{11}}) {
    const std::string place = " in row " + std::to_string(row) + ",";
    EXPECT_EQ(refusal(row, 1, 0), "");
    EXPECT_EQ(refusal(row, 1, 0.00009f), "");
    EXPECT_EQ(refusal(row, 0.9f, 0.09991f), "");
    EXPECT_TRUE(Mentions(refusal(row, 1, 0.00011f), "found a sum of 1.000110" + place, "expected 1 within 0.0001"));
    EXPECT_TRUE(Mentions(refusal(row, 0.9f, 0.09989f), "found a sum of 0.999890" + place));
    EXPECT_TRUE(Mentions(refusal(row, 1.5f, -0.5f), "found a negative weight" + place));
    EXPECT_TRUE(Mentions(refusal(row, 2, -1), "found a negative weight" + place));
  }
}

TEST(BundleTest, FacesNameThreeVerticesThatThereAre) {
  const auto refusal = [](size_t face, std::array<int32_t, 3> corners) {
    RawFile raw = BuildBundle({});
    for (size_t c = 0; c < 3; ++c) raw.SetInt("body.faces", 3 * face + c, corners[c]);
    return Refusal(raw);
  };
  for (const size_t face : {size_t{0}, size_t{4}, size_t{9}}) {
    const std::string place = " in face " + std::to_string(face) + ",";
    EXPECT_EQ(refusal(face, {0, 11, 1}), "");
    for (const std::array<int32_t, 3> twice : {std::array{3, 3, 4}, std::array{4, 3, 3}, std::array{3, 4, 3}}) {
      EXPECT_TRUE(Mentions(refusal(face, twice), "body.faces: found a vertex twice" + place, "three different"));
    }
    for (size_t c = 0; c < 3; ++c) {
      for (const int32_t vertex : {-1, 12}) {
        std::array corners = {1, 2, 3};
        corners[c] = vertex;
        EXPECT_TRUE(Mentions(refusal(face, corners), "found vertex " + std::to_string(vertex) + place, "from 0 to 11"));
      }
    }
  }
}

TEST(BundleTest, FeatureWidthIsWhatTheKernelsTake) {
  BundleSpec spec;
  spec.feature_width = 12;
  EXPECT_TRUE(Mentions(Refusal(BuildBundle(spec)), "feature width 12"));
  spec.feature_width = 72;
  EXPECT_TRUE(Mentions(Refusal(BuildBundle(spec)), "feature width 72"));
  spec.feature_width = 64;
  EXPECT_EQ(Refusal(BuildBundle(spec)), "");
  spec.feature_width = 8;
  spec.layers = 8;
  EXPECT_EQ(Refusal(BuildBundle(spec)), "");
  spec.layers = 9;
  EXPECT_TRUE(Mentions(Refusal(BuildBundle(spec)), "more than 8 layers"));
}

}  // namespace
}  // namespace dcloth::converter
