#include "converter/bundle.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BuildBundle;
using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;
using dcloth::testing::RawFile;

Bundle Parse(const RawFile& raw) { return BundleFrom(SafeFile::Parse(raw.Bytes(), "b.safetensors")); }
std::string Refusal(const RawFile& raw) {
  return ErrorText([&] { Parse(raw); });
}

TEST(BundleTest, ReadsEveryField) {
  BundleSpec spec;
  const RawFile raw = BuildBundle(spec);
  const Bundle bundle = Parse(raw);
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
  EXPECT_FALSE(Parse(BuildBundle(spec)).mesh);
  EXPECT_TRUE(Parse(BuildBundle(spec)).skeleton);
  spec.skeleton = false;
  EXPECT_FALSE(Parse(BuildBundle(spec)).skeleton);
  RawFile nearest_alone = BuildBundle({});
  std::erase_if(nearest_alone.tensors, [](const auto& tensor) { return tensor.name.starts_with("mesh."); });
  EXPECT_FALSE(Parse(nearest_alone).mesh);
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
  const Bundle bundle = Parse(raw);
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
  EXPECT_EQ(Parse(with_determinant(1e-9)).bind[0](1, 0), -1);
  EXPECT_EQ(Parse(with_determinant(-1e-9)).bind[0](1, 0), -1);
  EXPECT_TRUE(Mentions(Refusal(with_determinant(std::nextafter(1e-9, 0))), "without inverse in joint 'joint_0'"));
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

TEST(BundleTest, FeatureWidthIsWhatTheKernelsTake) {
  BundleSpec spec;
  spec.feature_width = 12;
  EXPECT_TRUE(Mentions(Refusal(BuildBundle(spec)), "feature width 12"));
  spec.feature_width = 72;
  EXPECT_TRUE(Mentions(Refusal(BuildBundle(spec)), "feature width 72"));
  spec.feature_width = 8;
  spec.layers = 9;
  EXPECT_TRUE(Mentions(Refusal(BuildBundle(spec)), "more than 8 layers"));
}

}  // namespace
}  // namespace dcloth::converter
