// Bundles with one thing wrong: what a refusal names; and the least and the most that a bundle may hold.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <string>
#include <utility>

#include "converter/bundle.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

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
    {"ZeroDeviation", [](RawFile* raw) { raw->SetFloat("features.deviation", 2, 0); }, "features.deviation",
     "at element 2"},
    {"NegativeDeviation", [](RawFile* raw) { raw->SetFloat("mesh.input_deviation", 1, -1); }, "mesh.input_deviation",
     "at element 1"},
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

// A determinant of 1e-9 is the least: in three floats that add up to it to the last of a double's bits, and one bit
// below.
TEST(BundleLimitsTest, TheLeastDeterminantOfABindMatrixIsTaken) {
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
  EXPECT_TRUE(Mentions(Refusal(with_determinant(std::nextafter(1e-9, 0))), "has no inverse for joint 'joint_0'"));
}

TEST(BundleLimitsTest, OddMetadataAreTaken) {
  RawFile raw = BuildBundle({.root_motion = RootMotion::kNone});
  EXPECT_EQ(ParseRawBundle(raw).feature_count(), 27u);
  EXPECT_EQ(ParseRawBundle(raw).root_motion, RootMotion::kNone);
  EXPECT_EQ(ParseRawBundle(BuildBundle({.root_motion = RootMotion::kAir})).feature_count(), 34u);
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

// A triangle is the least garment; no residual matrix is needed.
TEST(BundleLimitsTest, LeastAndMostVerticesAreTaken) {
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

TEST(BundleLimitsTest, EachNumberOfALastRowOfABindMatrixCounts) {
  for (size_t i = 12; i < 16; ++i) {
    for (const float value : {0.0f, 1.0f, 0.5f}) {
      RawFile raw = BuildBundle({});
      raw.SetFloat("character.bind", 16 + i, value);
      const std::string text = Refusal(raw);
      if (value == (i == 15 ? 1.0f : 0.0f)) {
        EXPECT_EQ(text, "");
      } else {
        EXPECT_TRUE(Mentions(text, "character.bind", "a last row other than 0 0 0 1 in the matrix of joint 'joint_1'"))
            << i;
      }
    }
  }
}

TEST(BundleLimitsTest, LimitsThemselvesAreTaken) {
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

TEST(BundleLimitsTest, ExtentsEndAt16777216) {
  for (const bool more : {false, true}) {
    RawFile raw = BuildBundle({});
    RawTensor& bias = raw.At("skeleton.gru.bias_hh");
    bias.type = SafeType::kF16;
    bias.shape = {(uint64_t{1} << 24) + (more ? 1 : 0)};
    bias.bytes.assign(2 * bias.shape[0], std::byte{0});
    EXPECT_TRUE(Mentions(Refusal(raw), "skeleton.gru.bias_hh", more ? "shape [16777217]" : "16777216 values"));
  }
}

TEST(BundleLimitsTest, SkinWeightsSumToOneAndMayBeZero) {
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
    EXPECT_TRUE(Mentions(refusal(row, 1, 0.00011f), "found a sum of 1.00011" + place, "expected 1 within 0.0001"));
    EXPECT_TRUE(Mentions(refusal(row, 0.9f, 0.09989f), "found a sum of 0.99989" + place));
    EXPECT_TRUE(Mentions(refusal(row, 1.5f, -0.5f), "found a negative weight" + place));
    EXPECT_TRUE(Mentions(refusal(row, 2, -1), "found a negative weight" + place));
  }
}

TEST(BundleLimitsTest, FacesNameThreeVerticesThatThereAre) {
  const auto refusal = [](size_t face, std::array<int32_t, 3> corners) {
    RawFile raw = BuildBundle({});
    for (size_t c = 0; c < 3; ++c) raw.SetInt("body.faces", 3 * face + c, corners[c]);
    return Refusal(raw);
  };
  for (const size_t face : {size_t{0}, size_t{4}, size_t{9}}) {
    const std::string place = " in face " + std::to_string(face) + ",";
    EXPECT_EQ(refusal(face, {0, 11, 1}), "");
    for (const std::array<int32_t, 3> twice : {std::array{3, 3, 4}, std::array{4, 3, 3}, std::array{3, 4, 3}}) {
      EXPECT_TRUE(Mentions(refusal(face, twice), "body.faces: found the same vertex twice" + place, "three different"));
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

TEST(BundleLimitsTest, FeatureWidthIsWhatTheKernelsTake) {
  BundleSpec spec{.feature_width = 12};
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
