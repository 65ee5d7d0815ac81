#include "converter/integer_layer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "converter/convert.h"
#include "converter/rollout.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

// Integers times the stacked weights are inputs times the folded ones, whatever the steps.
TEST(IntegerLayerTest, StepsAreInTheWeights) {
  const BundleSpec spec{.feature_width = 16};
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
        ASSERT_NEAR(32767 * stored.weights(k, hidden + c), folded.hidden_gates(k, c), 1e-6);
      }
      for (Eigen::Index c = 0; c < 16; ++c) {
        ASSERT_NEAR(32767 * stored.weights(k, hidden + 2 * 16 + c), folded.hidden_candidate(k, c), 1e-6);
        ASSERT_NEAR(32767 * stored.weights(k, hidden + 3 * 16 + c), layers[l].w_o(k, c), 1e-6);
      }
    }
  }
}

// 32767 steps reach the largest that the norm before gives: four deviations, or all that F features allow.
TEST(IntegerLayerTest, StepsReachWhatTheNormGives) {
  for (const uint32_t width : {16u, 32u}) {
    const BundleSpec spec{.feature_width = width};
    Bundle bundle = ParseBundle(spec);
    MeshLayerWeights& before = bundle.mesh->layers[0];
    before.norm_weight.setConstant(-0.5f);
    before.norm_bias.setConstant(0.25f);
    before.prelu = 0.1f;
    const IntegerLayer stored =
        StackIntegerLayer(FoldMeshLayer(bundle.mesh->layers[1]), bundle.mesh->layers[1].w_o, &before);
    const double largest = 0.5 * std::min(std::sqrt(width - 1.0), 4.0) + 0.25;
    EXPECT_NEAR(stored.input_inverse_steps[3], 32767 / largest, 0.05);
    before.norm_weight[3] = before.norm_bias[3] = 0;  // a dead feature keeps a finite step
    EXPECT_TRUE(
        std::isfinite(StackIntegerLayer(FoldMeshLayer(bundle.mesh->layers[1]), bundle.mesh->layers[1].w_o, &before)
                          .input_inverse_steps[3]));
  }
}

class IntegerClothTest : public ::testing::Test {
 protected:
  IntegerClothTest() {
    const BundleSpec spec{.vertices = 300, .feature_width = 32};
    bundle_ = ParseBundle(spec);
    folded_ = FoldBundle(bundle_, 8, 8);
    sequence_ = ParseSequence(spec, 24);
    for (size_t l = 0; l < bundle_.mesh->layers.size(); ++l) {
      integers_.formats["mesh_stage.layers." + std::to_string(l) + ".weights"] = Precision::kInt8;
    }
  }

  // [frames, n, 3] one after another.
  std::vector<float> Positions(const PrecisionPlan& plan, uint32_t stages) const {
    return Played(OpenModel(WriteModel(Assemble(bundle_, folded_, plan)), "b"), sequence_, stages);
  }

  static double Rms(std::span<const float> a, std::span<const float> b) {
    double sum = 0;
    for (size_t i = 0; i < a.size(); ++i) sum += double{a[i] - b[i]} * double{a[i] - b[i]};
    return std::sqrt(sum / static_cast<double>(a.size()));
  }

  Bundle bundle_;
  FoldedBundle folded_;
  Sequence sequence_;
  PrecisionPlan integers_;
};

// Their products' error is a weight's of int8: far from what a wrong scale or order would give.
TEST_F(IntegerClothTest, MovesAsWithFloats) {
  const std::vector<float> floats = Positions({}, DCLOTH_STAGES_MESH);
  const double stage = Rms(floats, Positions({}, DCLOTH_STAGES_SKELETON));
  const double error = Rms(floats, Positions(integers_, DCLOTH_STAGES_MESH));
  EXPECT_GT(error, 0);
  EXPECT_LT(error, 0.02 * stage);
}

// In a held pose rounded inputs must not keep each other changing.
TEST_F(IntegerClothTest, RestsInAHeldPose) {
  constexpr size_t kHeld = 400;
  const size_t frame = sequence_.joint_matrices.size() / sequence_.frame_count;
  const std::vector<float> pose(sequence_.joint_matrices.end() - static_cast<std::ptrdiff_t>(frame),
                                sequence_.joint_matrices.end());
  for (size_t i = 0; i < kHeld; ++i) {
    sequence_.joint_matrices.insert(sequence_.joint_matrices.end(), pose.begin(), pose.end());
  }
  sequence_.frame_count += kHeld;
  sequence_.truth.clear();
  sequence_.truth_vertex_count = 0;
  const std::vector<float> found = Positions(integers_, DCLOTH_STAGES_MESH);
  const double stage = Rms(found, Positions(integers_, DCLOTH_STAGES_SKELETON));
  const size_t size = found.size() / sequence_.frame_count;
  double largest = 0;
  for (size_t back = 1; back <= 100; ++back) {
    const std::span<const float> now = std::span(found).last(back * size).first(size);
    const std::span<const float> before = std::span(found).last((back + 1) * size).first(size);
    largest = std::max(largest, Rms(now, before));
  }
  RecordProperty("share_of_the_stage", std::to_string(largest / stage));
  EXPECT_LT(largest, 1e-4 * stage);
}

}  // namespace
}  // namespace dcloth::converter
