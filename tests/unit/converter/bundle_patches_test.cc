// Bundles with a patch stage: what is read, and what is wrong with others.
#include "converter/bundle_patches.h"

#include <gtest/gtest.h>

#include <functional>
#include <numeric>
#include <string>
#include <vector>

#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

TEST(BundlePatchesTest, SizesFollowFromTheTensors) {
  for (const bool half : {false, true}) {
    const Bundle bundle = ParseBundle({.half_weights = half, .patches = 4});
    ASSERT_TRUE(bundle.patches);
    EXPECT_FALSE(bundle.skeleton || bundle.mesh);
    const PatchWeights& patches = *bundle.patches;
    EXPECT_EQ(patches.patch_count, 4u);
    EXPECT_EQ(patches.point_count, 3u);
    EXPECT_EQ(patches.neighbour_count, 2u);
    EXPECT_EQ(patches.source_count, 4u);
    EXPECT_EQ(patches.mix.size(), 2u);
    EXPECT_EQ(patches.embedding.cols(), 5);
    EXPECT_EQ(patches.axes.cols(), 9);
    EXPECT_EQ(patches.point_parts.rows(), 12);
    EXPECT_EQ(patches.map.cols(), 36);
    std::vector<uint32_t> seen;
    for (const std::vector<uint32_t>& group : patches.groups) {
      EXPECT_FALSE(group.empty());
      seen.insert(seen.end(), group.begin(), group.end());
    }
    std::sort(seen.begin(), seen.end());
    std::vector<uint32_t> all(bundle.vertex_count());
    std::iota(all.begin(), all.end(), 0u);
    EXPECT_EQ(seen, all);
  }
}

// [K, R, 4, 4] as a row of 16 for each point.
TEST(BundlePatchesTest, PartsOfAPointAreARow) {
  RawFile raw = BuildBundle({.patches = 4});
  raw.SetFloat("patch.point_parts", 7 * 16 + 5, 0.375f);
  EXPECT_EQ(ParseRawBundle(raw).patches->point_parts(7, 5), 0.375f);
}

TEST(BundlePatchesTest, NeighboursAndNumbersOfAPatchMayBeLeftOut) {
  const Bundle bundle = ParseBundle({.patches = 4, .patch_neighbours = 0, .embedding = 0});
  EXPECT_EQ(bundle.patches->neighbour_count, 0u);
  EXPECT_TRUE(bundle.patches->near.empty());
  EXPECT_EQ(bundle.patches->embedding.size(), 0);
}

TEST(BundlePatchesTest, TheLargestIsTakenAndOneMoreIsNot) {
  BundleSpec spec{.vertices = 256 * 16,
                  .patches = 256,
                  .patch_points = 16,
                  .patch_width = 256,
                  .patch_neighbours = 4,
                  .patch_layers = 8,
                  .capsules = 32,
                  .embedding = 32,
                  .sources = 32};
  EXPECT_EQ(Refusal(BuildBundle(spec)), "");
  const auto refused = [&](auto change, const char* tensor, const char* found, const char* expected) {
    BundleSpec more{.vertices = 600, .patches = 4};
    change(&more);
    EXPECT_TRUE(Mentions(Refusal(BuildBundle(more)), tensor, found, expected));
  };
  refused([](BundleSpec* s) { s->patches = 257; }, "patch.joints", "257 patches", "1 to 256");
  refused([](BundleSpec* s) { s->patch_points = 17; }, "patch.point_joints", "17 points of a patch", "1 to 16");
  refused([](BundleSpec* s) { s->patch_width = 264; }, "patch.enter.weight", "width 264", "a multiple of 8");
  refused([](BundleSpec* s) { s->patch_width = 20; }, "patch.enter.weight", "width 20", "a multiple of 8");
  refused([](BundleSpec* s) { s->patch_neighbours = 5; }, "patch.near", "5 neighbours of a patch", "1 to 4");
  refused([](BundleSpec* s) { s->patch_layers = 9; }, "patch.mix.8.weight", "more than 8 layers", "1 to 8");
  refused([](BundleSpec* s) { s->capsules = 33; }, "patch.capsule_joints", "33 capsules", "1 to 32");
  refused([](BundleSpec* s) { s->embedding = 33; }, "patch.embedding", "33 numbers of a patch", "1 to 32");
  refused([](BundleSpec* s) { s->patches = 12, s->sources = 33; }, "patch.map.sources", "33 sources", "1 to 32");
  refused([](BundleSpec* s) { s->sources = 3; }, "patch.map.sources", "3 sources of a point", "an even number");
}

struct Fault {
  const char* name;
  std::function<void(RawFile*)> make;
  const char* tensor;
  const char* found;
};

class PatchFaultTest : public ::testing::TestWithParam<Fault> {};

TEST_P(PatchFaultTest, IsRefused) {
  RawFile raw = BuildBundle({.patches = 4});
  ASSERT_EQ(Refusal(raw), "");
  GetParam().make(&raw);
  EXPECT_TRUE(Mentions(Refusal(raw), "b.safetensors", GetParam().tensor, GetParam().found));
}

const Fault kFaults[] = {
    {"JointTooHigh", [](RawFile* raw) { raw->SetInt("patch.joints", 3, 6); }, "patch.joints", "6 at element 3"},
    {"JointNegative", [](RawFile* raw) { raw->SetInt("patch.joints", 0, -1); }, "patch.joints", "-1 at element 0"},
    {"PointJoint", [](RawFile* raw) { raw->SetInt("patch.point_joints", 47, 6); }, "patch.point_joints",
     "6 at element 47"},
    {"CapsuleJoint", [](RawFile* raw) { raw->SetInt("patch.capsule_joints", 2, 6); }, "patch.capsule_joints",
     "6 at element 2"},
    {"Limb", [](RawFile* raw) { raw->SetInt("patch.limbs", 15, 3); }, "patch.limbs", "3 at element 15"},
    {"Neighbour", [](RawFile* raw) { raw->SetInt("patch.near", 15, 4); }, "patch.near", "4 at element 15"},
    {"Source", [](RawFile* raw) { raw->SetInt("patch.map.sources", 0, 12); }, "patch.map.sources", "12 at element 0"},
    {"SourceTwice", [](RawFile* raw) { raw->SetInt("patch.map.sources", 7, 1); }, "patch.map.sources",
     "point 1 twice for point 1"},
    {"Group", [](RawFile* raw) { raw->SetInt("patch.map.groups", 59, 12); }, "patch.map.groups", "12 at element 59"},
    {"PointWithoutVertices",
     [](RawFile* raw) {
       for (size_t v = 0; v < 60; ++v) raw->SetInt("patch.map.groups", v, static_cast<int32_t>(v % 11));
     },
     "patch.map.groups", "no vertex of point 11"},
    {"LongAxis", [](RawFile* raw) { raw->SetFloat("patch.axes", 9 + 4, 3); }, "patch.axes", "in patch 1"},
    {"Radius", [](RawFile* raw) { raw->SetFloat("patch.capsules", 15, -0.1f); }, "patch.capsules",
     "a radius below 0 in capsule 1"},
    {"KeepGrows", [](RawFile* raw) { raw->SetFloat("patch.keep", 2, 1.5f); }, "patch.keep", "1.5"},
    {"KeepNegative", [](RawFile* raw) { raw->SetFloat("patch.keep", 0, -0.5f); }, "patch.keep", "-0.5"},
    {"EmbeddingLeftOut", [](RawFile* raw) { raw->Erase("patch.embedding"); }, "patch.enter.weight", "[16, 95]"},
    {"NeighboursLeftOut", [](RawFile* raw) { raw->Erase("patch.near"); }, "patch.mix.0.weight", "[16, 48]"},
    {"HiddenBias", [](RawFile* raw) { raw->Replace("patch.gates.bias_hh", {48}, std::vector<float>(48)); },
     "patch.gates.bias_hh", "an unknown tensor"},
    {"BesideASkeleton",
     [](RawFile* raw) {
       for (const auto& tensor : BuildBundle({.mesh = false}).tensors) {
         if (tensor.name.starts_with("skeleton.")) raw->tensors.push_back(tensor);
       }
     },
     "patch.joints", "a patch stage beside a skeleton stage"},
};
INSTANTIATE_TEST_SUITE_P(Patches, PatchFaultTest, ::testing::ValuesIn(kFaults),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace dcloth::converter
