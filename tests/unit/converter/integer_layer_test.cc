#include "converter/integer_layer.h"

#include <gtest/gtest.h>

#include <cmath>

#include "converter/convert.h"
#include "converter/rollout.h"
#include "tests/unit/converter/bundle_builder.h"

namespace dcloth::converter {
namespace {

using dcloth::testing::BuildBundle;
using dcloth::testing::BuildSequence;
using dcloth::testing::BundleSpec;

Bundle ParseBundle(const BundleSpec& spec) {
  return BundleFrom(SafeFile::Parse(BuildBundle(spec).Bytes(), "b.safetensors"));
}

// Integers times the stacked weights are inputs times the folded ones, whatever the steps.
TEST(IntegerLayerTest, StepsAreInTheWeights) {
  BundleSpec spec;
  spec.feature_width = 16;
  const Bundle bundle = ParseBundle(spec);
  const std::vector<MeshLayerWeights>& layers = bundle.mesh->layers;
  for (size_t l = 0; l < layers.size(); ++l) {
    const FoldedMeshLayer folded = FoldMeshLayer(layers[l]);
    const IntegerLayer stored = StackIntegerLayer(folded, layers[l].w_o, l == 0 ? nullptr : &layers[l - 1]);
    ASSERT_EQ(stored.weights.rows(), 16);
    ASSERT_EQ(stored.weights.cols(), l == 0 ? 4 * 16 : 7 * 16);
    ASSERT_EQ(stored.input_inverse_steps.size(), l == 0 ? 0 : 16);
    for (Eigen::Index k = 0; k < 16; ++k) {
      const Eigen::Index hidden = stored.weights.cols() - 4 * 16;
      for (Eigen::Index c = 0; c < hidden; ++c) {
        ASSERT_NEAR(stored.weights(k, c) * stored.input_inverse_steps[k], folded.input_gates(k, c), 1e-6);
      }
      for (Eigen::Index c = 0; c < 2 * 16; ++c) {
        ASSERT_NEAR(127 * stored.weights(k, hidden + c), folded.hidden_gates(k, c), 1e-6);
      }
      for (Eigen::Index c = 0; c < 16; ++c) {
        ASSERT_NEAR(127 * stored.weights(k, hidden + 2 * 16 + c), folded.hidden_candidate(k, c), 1e-6);
        ASSERT_NEAR(127 * stored.weights(k, hidden + 3 * 16 + c), layers[l].w_o(k, c), 1e-6);
      }
    }
  }
}

// 127 steps reach the largest that the norm before gives: four deviations, or all that F features allow.
TEST(IntegerLayerTest, StepsReachWhatTheNormGives) {
  for (const uint32_t width : {16u, 32u}) {
    BundleSpec spec;
    spec.feature_width = width;
    Bundle bundle = ParseBundle(spec);
    MeshLayerWeights& before = bundle.mesh->layers[0];
    before.norm_weight.setConstant(-0.5f);
    before.norm_bias.setConstant(0.25f);
    before.prelu = 0.1f;
    const IntegerLayer stored =
        StackIntegerLayer(FoldMeshLayer(bundle.mesh->layers[1]), bundle.mesh->layers[1].w_o, &before);
    const double largest = 0.5 * std::min(std::sqrt(width - 1.0), 4.0) + 0.25;
    EXPECT_NEAR(stored.input_inverse_steps[3], 127 / largest, 1e-4);
    before.norm_weight[3] = before.norm_bias[3] = 0;  // a dead feature keeps a finite step
    EXPECT_TRUE(std::isfinite(
        StackIntegerLayer(FoldMeshLayer(bundle.mesh->layers[1]), bundle.mesh->layers[1].w_o, &before)
            .input_inverse_steps[3]));
  }
}

size_t LayersInIntegers(const ConvertResult& result) {
  size_t count = 0;
  for (const TensorReport& tensor : result.report.tensors) {
    count += tensor.name.starts_with("mesh_stage.layers.") && tensor.name.ends_with(".weights") && tensor.dtype == "i8";
  }
  return count;
}

TEST(IntegerLayerTest, WideLayersOfInt8ModelsHaveThem) {
  for (const uint32_t width : {8u, 16u, 40u}) {
    BundleSpec spec;
    spec.feature_width = width;
    const Bundle bundle = ParseBundle(spec);
    for (const Precision precision : {Precision::kFp32, Precision::kFp16, Precision::kInt8}) {
      ConvertOptions options;
      options.precision = precision;
      const size_t expected = precision == Precision::kInt8 && width >= 16 ? bundle.mesh->layers.size() : 0;
      const ConvertResult result = Convert(bundle, options);
      EXPECT_EQ(LayersInIntegers(result), expected) << width << " " << PrecisionName(precision);
      EXPECT_EQ(OpenModel(result.bytes).info().format_minor, expected > 0 ? 3u : 2u);
    }
  }
}

// Their products' error is a few levels of 127: far from what a wrong scale or order would give.
TEST(IntegerLayerTest, MoveTheClothAsFloatsDo) {
  BundleSpec spec;
  spec.feature_width = 32;
  const Bundle bundle = ParseBundle(spec);
  const FoldedBundle folded = FoldBundle(bundle, 8, 8);
  const Sequence sequence = SequenceFrom(SafeFile::Parse(BuildSequence(spec, 24).Bytes(), "s.safetensors"));
  const auto positions = [&](const PrecisionPlan& plan, uint32_t stages) {
    const OpenModel model(WriteModel(Assemble(bundle, folded, plan)), "b");
    std::vector<float> all;
    Rollout(model, sequence, stages, [&](size_t, std::span<const float> frame, std::span<const float>) {
      all.insert(all.end(), frame.begin(), frame.end());
    });
    return all;
  };
  const auto rms = [](const std::vector<float>& a, const std::vector<float>& b) {
    double sum = 0;
    for (size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return std::sqrt(sum / static_cast<double>(a.size()));
  };
  const std::vector<float> floats = positions({}, DCLOTH_STAGES_MESH);
  const double stage = rms(floats, positions({}, DCLOTH_STAGES_SKELETON));
  PrecisionPlan plan;
  for (size_t l = 0; l < bundle.mesh->layers.size(); ++l) {
    plan.formats["mesh_stage.layers." + std::to_string(l) + ".weights"] = Precision::kInt8;
  }
  const double error = rms(floats, positions(plan, DCLOTH_STAGES_MESH));
  EXPECT_GT(error, 0);
  EXPECT_LT(error, 0.02 * stage);
  RecordProperty("share_of_the_stage", std::to_string(error / stage));
}

}  // namespace
}  // namespace dcloth::converter
