// Bundles with one thing wrong: what a refusal names.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "converter/bundle.h"
#include "tests/unit/converter/bundle_builder.h"
#include "tests/unit/converter/bundle_refusal.h"
#include "tests/unit/converter/error_text.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BuildBundle;
using dcloth::testing::BundleSpec;
using dcloth::testing::ErrorText;
using dcloth::testing::Mentions;
using dcloth::testing::RawFile;
using dcloth::testing::Refusal;

// Of bundles with so many patches, or with the other stages.
class BundleDamageTest : public ::testing::TestWithParam<uint32_t> {};

INSTANTIATE_TEST_SUITE_P(Stages, BundleDamageTest, ::testing::Values(0u, 4u),
                         [](const auto& test) { return test.param == 0 ? "Mesh" : "Patches"; });

// Missing one tensor at a time: the name is in the message. A group's absence is legal only as a whole.
TEST_P(BundleDamageTest, EachMissingTensorIsNamed) {
  const RawFile whole = BuildBundle({.patches = GetParam()});
  ASSERT_GT(whole.tensors.size(), 40u);
  for (const auto& tensor : whole.tensors) {
    if (tensor.name == "patch.embedding" || tensor.name == "patch.near") continue;  // optional
    RawFile raw = whole;
    raw.Erase(tensor.name);
    EXPECT_TRUE(Mentions(Refusal(raw), "tensor " + tensor.name + ": found no such tensor")) << tensor.name;
  }
}

// One extent more in each dimension of each tensor: the shape found is in the message. Where a tensor defines a size,
// the first one that depends on it may be the one named.
TEST_P(BundleDamageTest, EachWrongShapeIsRefused) {
  const RawFile whole = BuildBundle({.patches = GetParam()});
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
  EXPECT_GT(named, tried * 5 / 6);
}

TEST_P(BundleDamageTest, EachWrongDtypeIsRefused) {
  const RawFile whole = BuildBundle({.patches = GetParam()});
  for (const auto& tensor : whole.tensors) {
    RawFile raw = whole;
    auto& changed = raw.At(tensor.name);
    changed.type = changed.type == SafeType::kI32 ? SafeType::kU32 : SafeType::kI32;
    EXPECT_TRUE(Mentions(Refusal(raw), tensor.name, "dtype")) << tensor.name;
  }
}

TEST_P(BundleDamageTest, NanAndInfinityAnywhereAreRefused) {
  const RawFile whole = BuildBundle({.patches = GetParam()});
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

TEST(BundleFaultsTest, EveryTruncatedPrefixIsRefused) {
  const BundleSpec spec{.vertices = 12,
                        .joints = 3,
                        .feature_joints = 1,
                        .bones = 2,
                        .body_vertices = 3,
                        .static_width = 2,
                        .skeleton_basis = 2,
                        .mesh_basis = 2,
                        .layers = 1,
                        .mesh_width = 2};
  const AlignedBytes whole = BuildBundle(spec).Bytes();
  ASSERT_EQ(ErrorText([&] { BundleFrom(SafeFile::Parse(whole, "b")); }), "");
  for (size_t size = 0; size < whole.size(); ++size) {
    AlignedBytes prefix(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
    ASSERT_TRUE(Mentions(ErrorText([&] { BundleFrom(SafeFile::Parse(std::move(prefix), "b")); }), "b: ")) << size;
  }
}

TEST(BundleFaultsTest, EachMissingMetadatumIsNamed) {
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
    {"Unknown", [](RawFile* raw) { raw->Replace("mesh.layer.0.b", {1}, {0}); }, "mesh.layer.0.b", "an unknown tensor"},
    {"FaceTooHigh", [](RawFile* raw) { raw->SetInt("template.faces", 4, 60); }, "template.faces",
     "vertex 60 in face 1"},
    {"FaceNegative", [](RawFile* raw) { raw->SetInt("body.faces", 0, -1); }, "body.faces", "vertex -1 in face 0"},
    {"FaceDegenerate", [](RawFile* raw) { raw->SetInt("template.faces", 1, 0); }, "template.faces",
     "the same vertex twice in face 0"},
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
     "character.bind", "has no inverse for joint 'joint_0'"},
    {"TransposedBind", [](RawFile* raw) { raw->SetFloat("character.bind", 12, 0.5f); }, "character.bind", "0 0 0 1"},
    Meta("Format", "format", "onnx", "'onnx'"),
    Meta("Version", "format_version", "2", "'2'"),
    Meta("NoName", "garment", "", "a garment name that is empty"),
    Meta("TickRateZero", "tick_rate", "0", "'0'"),
    Meta("TickRateText", "tick_rate", "30fps", "'30fps'"),
    Meta("TickRateNan", "tick_rate", "nan", "'nan'"),
    Meta("TickRateHuge", "tick_rate", "1e9", "'1e9'"),
    Meta("TickRateAboveTheLimit", "tick_rate", "1000.001", "'1000.001', expected a number above 0, at most 1000"),
    Meta("TickRateNegative", "tick_rate", "-30", "'-30'"),
    Meta("TickRateEmpty", "tick_rate", "", "''"),
    Meta("HipsUnknown", "hips", "pelvis", "'pelvis'"),
    Meta("JointTwice", "joint_names", R"(["a","b","a","c","d","e"])", "'a' twice"),
    Meta("JointEmpty", "joint_names", R"(["a","","b","c","d","e"])", "a name that is empty"),
    Meta("JointNotText", "joint_names", "[1]", "a JSON list"),
    Meta("JointsNone", "joint_names", "[]", "a JSON list"),
    Meta("JointsNoJson", "joint_names", "[\"a\"", "a JSON list"),
    Meta("ParentsNoList", "parents", "0", "a JSON list of 6 indices into joint_names, or -1"),
    Meta("ParentsFew", "parents", "[-1,0,1,2,3]", "a JSON list of 6"),
    Meta("ParentsMany", "parents", "[-1,0,1,2,3,4,5]", "a JSON list of 6"),
    Meta("ParentPastTheEnd", "parents", "[-1,0,1,2,3,6]", "a JSON list of 6"),
    Meta("ParentBelow", "parents", "[-1,0,1,2,3,-2]", "a JSON list of 6"),
    Meta("ParentHuge", "parents", "[-1,0,1,2,3,18446744073709551615]", "a JSON list of 6"),
    Meta("ParentFraction", "parents", "[-1,0,1,2,3,0.5]", "a JSON list of 6"),
    Meta("ParentName", "parents", R"([-1,0,1,2,3,"joint_0"])", "a JSON list of 6"),
    Meta("ParentItself", "parents", "[-1,0,1,2,4,4]", "in which joint 4 is below itself"),
    Meta("ParentsInACircle", "parents", "[2,0,1,-1,3,3]", "in which joint 0 is below itself"),
    Meta("BoneUnknown", "bones", R"(["joint_0","tail"])", "'tail'"),
    Meta("BoneTwice", "bones", R"(["joint_0","joint_0"])", "twice"),
    Meta("FeatureUnknown", "feature_joints", R"(["tail"])", "'tail'"),
    Meta("RootMotion", "root_motion", "yes", "'yes'"),
    Meta("RootMotionOfAir", "root_motion", "air", "[34]"),
    Meta("Training", "training", "[]", "'[]'"),
    Meta("JointsText", "joint_names", R"("abcdef")", "a JSON list"),
    Meta("JointsObject", "joint_names", R"({"a":"b"})", "a JSON list"),
    Meta("JointZeroByte", "joint_names", R"(["a\u0000b","b","c","d","e","f"])", "has a zero byte"),
    {"NameZeroByte", [](RawFile* raw) { raw->metadata["garment"].append("\0x", 2); },
     "expected a name without zero bytes", "has a zero byte"},
    {"ZeroByte", [](RawFile* raw) { raw->metadata["bones"].append("\0x", 2); }, "bones", "a JSON list"},
};
INSTANTIATE_TEST_SUITE_P(Bundle, BundleFaultTest, ::testing::ValuesIn(kFaults),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace dcloth::converter
