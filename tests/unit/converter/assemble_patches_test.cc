// The patch stage in a model file.
#include "converter/assemble_patches.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <numeric>
#include <set>

#include "converter/convert.h"
#include "converter/rollout.h"
#include "converter/stages.h"
#include "dcloth/dcloth.h"
#include "kernels/matvec/matvec.h"
#include "tests/unit/converter/converter_testing.h"

#ifndef FLATBUFFERS_MAX_ALIGNMENT
#define FLATBUFFERS_MAX_ALIGNMENT 64
#endif
#include "dcloth_generated.h"

namespace dcloth::converter {
namespace {

constexpr BundleSpec kSpec{.patches = 4};

ModelParts Parts(const Bundle& bundle, Precision precision) {
  return Assemble(bundle, FoldBundle(bundle, 8, 8), {precision, {}});
}

template <typename Number>
std::vector<Number> Numbers(const PackedTensor& tensor) {
  std::vector<Number> numbers(tensor.bytes.size() / sizeof(Number));
  std::memcpy(numbers.data(), tensor.bytes.data(), tensor.bytes.size());
  return numbers;
}

std::vector<const PackedLinear*> Layers(const PatchStageParts& patches) {
  std::vector<const PackedLinear*> layers = {&patches.enter, &patches.input_gates, &patches.hidden_gates, &patches.out,
                                             &patches.map};
  for (const PackedLinear& layer : patches.mix) layers.push_back(&layer);
  return layers;
}

TEST(AssemblePatchesTest, EveryPrecisionOpens) {
  constexpr StoredType kTypes[] = {StoredType::kF32, StoredType::kF16, StoredType::kI8};
  const Bundle bundle = ParseBundle(kSpec);
  for (const Precision precision : kPrecisions) {
    const ModelParts parts = Parts(bundle, precision);
    for (const PackedLinear* layer : Layers(*parts.patches)) {
      // What reads and what moves the cloth is small, and its rounding comes back every tick.
      const bool integers = precision == Precision::kInt8,
                 halves = layer == &parts.patches->enter || layer == &parts.patches->out;
      const StoredType type = integers && halves ? StoredType::kF16 : kTypes[static_cast<size_t>(precision)];
      EXPECT_EQ(layer->weights.type, type) << layer->weights.report.name;
      EXPECT_FALSE(layer->row_scales) << layer->weights.report.name;
      EXPECT_EQ(layer->column_scales.has_value(), type == StoredType::kI8);
      EXPECT_EQ(layer->bias.has_value(), layer != &parts.patches->hidden_gates) << layer->weights.report.name;
    }
    const OpenModel model(WriteModel(parts));
    EXPECT_EQ(model.info().format_minor, 8u);
  }
}

TEST(AssemblePatchesTest, WhatMayBeLeftOutIs) {
  const Bundle bundle = ParseBundle({.patches = 4, .patch_neighbours = 0, .embedding = 0});
  const ModelParts parts = Parts(bundle, Precision::kInt8);
  EXPECT_FALSE(parts.patches->near || parts.patches->embedding);
  EXPECT_EQ(OpenModel(WriteModel(parts)).info().format_minor, 8u);
}

TEST(AssemblePatchesTest, OtherModelsKeepTheirVersion) {
  EXPECT_LT(OpenModel(WriteModel(Parts(ParseBundle({}), Precision::kFp32))).info().format_minor, 8u);
}

// Each vertex' nine numbers of each source, from the panels where the engine looks for them.
TEST(AssemblePatchesTest, MapIsByGroupAndComponent) {
  const Bundle bundle = ParseBundle(kSpec);
  const PatchWeights& patches = *bundle.patches;
  const PatchStageParts parts = *Parts(bundle, Precision::kFp32).patches;
  const std::vector<float> panels = Numbers<float>(parts.map.weights), bias = Numbers<float>(*parts.map.bias);
  const std::vector<uint16_t> vertices = Numbers<uint16_t>(parts.vertices);
  const std::vector<uint32_t> starts = Numbers<uint32_t>(parts.group_starts);
  ASSERT_EQ(starts.size(), 13u);
  const size_t rows = 3 * size_t{patches.source_count}, panel = 32 * rows;
  EXPECT_EQ(parts.map.weights.report.shape, (std::vector<uint32_t>{12, static_cast<uint32_t>(bias.size())}));
  const auto weight = [&](size_t row, size_t column) { return panels[column / 32 * panel + 32 * row + column % 32]; };
  size_t column = 0, filled = 0;
  for (size_t group = 0; group + 1 < starts.size(); ++group) {
    const size_t first = column;
    for (uint32_t i = starts[group]; i < starts[group + 1]; ++i) {
      for (size_t a = 0; a < 3; ++a, ++column) {
        EXPECT_EQ(bias[column], patches.offsets(vertices[i], static_cast<Eigen::Index>(a)));
        for (size_t m = 0; m < patches.source_count; ++m) {
          for (size_t b = 0; b < 3; ++b) {
            const auto at = static_cast<Eigen::Index>(9 * m + 3 * a + b);
            EXPECT_EQ(weight(3 * m + b, column), patches.map(vertices[i], at)) << group << " " << column;
          }
        }
      }
    }
    for (const size_t end = first + kernels::PaddedColumns(column - first); column < end; ++column, ++filled) {
      EXPECT_EQ(bias[column], 0);
      for (size_t row = 0; row < rows; ++row) EXPECT_EQ(weight(row, column), 0);
    }
  }
  EXPECT_EQ(column, bias.size());
  EXPECT_GT(filled, 0u);
}

// Joints that only patches need are among those that a host supplies, under the names that they had.
TEST(AssemblePatchesTest, JointsAreThoseOfTheModel) {
  RawFile raw = BuildBundle({.joints = 8, .feature_joints = 2, .bones = 2, .patches = 4});
  for (size_t i = 0; i < 48; ++i) raw.SetInt("patch.point_joints", i, 6);
  for (size_t i = 0; i < 4; ++i) raw.SetInt("patch.joints", i, 4);
  for (size_t i = 0; i < 3; ++i) raw.SetInt("patch.capsule_joints", i, 3);
  const ModelParts parts = Parts(ParseRawBundle(raw), Precision::kFp32);
  const std::vector<std::string> expected = {"joint_0", "joint_1", "joint_3", "joint_4", "joint_6", "joint_7"};
  EXPECT_EQ(parts.joint_names, expected);
  EXPECT_EQ(Numbers<uint8_t>(parts.patches->joints), std::vector<uint8_t>(4, 3));
  EXPECT_EQ(Numbers<uint8_t>(parts.patches->capsule_joints), std::vector<uint8_t>(3, 2));
  EXPECT_EQ(Numbers<uint8_t>(parts.patches->point_joints), std::vector<uint8_t>(48, 4));
}

TEST(AssemblePatchesTest, ConvertsWithAReport) {
  const Bundle bundle = ParseBundle(kSpec);
  std::set<uint64_t> sizes;
  for (const Precision precision : kPrecisions) {
    const ConvertResult result = Convert(bundle, {.precision = precision});
    EXPECT_EQ(result.report.stages, DCLOTH_STAGES_MESH);
    EXPECT_EQ(result.report.rank.full, 0u);
    std::set<std::string> names;
    for (const TensorReport& tensor : result.report.tensors)
      EXPECT_TRUE(names.insert(tensor.name).second) << tensor.name;
    for (const char* name : {"patch_stage.enter.weights", "patch_stage.mix.1.weights", "patch_stage.map.bias"})
      EXPECT_EQ(names.count(name), 1u) << name;
    sizes.insert(result.report.model_bytes);
  }
  EXPECT_EQ(sizes.size(), 3u);
}

// One moving stage, which the level of the skeleton stage has too.
TEST(AssemblePatchesTest, StagesBeforeItAreAModelOfTheirOwn) {
  const Bundle bundle = ParseBundle(kSpec);
  EXPECT_EQ(StagesOf(bundle), DCLOTH_STAGES_MESH);
  EXPECT_TRUE(KeepStages(bundle, DCLOTH_STAGES_SKELETON).patches);
  EXPECT_FALSE(KeepStages(bundle, DCLOTH_STAGES_STATIC).patches);
  EXPECT_EQ(Convert(bundle, {.stages = DCLOTH_STAGES_STATIC}).report.stages, DCLOTH_STAGES_STATIC);
}

// In the bundle's own names and order.
TEST(AssemblePatchesTest, AWeightThatHalvesCannotHoldIsToldByItsPlace) {
  const auto refusal = [](const char* tensor, size_t index) {
    RawFile raw = BuildBundle(kSpec);
    raw.SetFloat(tensor, index, 1e5f);
    return ErrorText([&] { Convert(ParseRawBundle(raw), {.precision = Precision::kFp16}); });
  };
  // [n, M, 3, 3] with M 4, and [W, (1 + S) W] with W 16 and S 2.
  EXPECT_TRUE(Mentions(refusal("patch.map.weights", 36 * 11 + 9 * 2 + 3 + 2), "patch.map.weights",
                       "element [11, 2, 1, 2] is the largest"));
  EXPECT_TRUE(Mentions(refusal("patch.mix.1.weight", 48 * 3 + 5), "patch.mix.1.weight", "element [3, 5]"));
  EXPECT_TRUE(Mentions(refusal("patch.enter.weight", 0), "patch.enter.weight", "element [0, 0]"));
  EXPECT_TRUE(Mentions(refusal("patch.out.weight", 0), "patch.out.weight", "element [0, 0]"));
  EXPECT_TRUE(Mentions(refusal("patch.gates.weight_ih", 1), "patch.gates.weight_ih", "element [0, 1]"));
  EXPECT_TRUE(Mentions(refusal("patch.gates.weight_hh", 16), "patch.gates.weight_hh", "element [1, 0]"));
}

}  // namespace
}  // namespace dcloth::converter
