#include "converter/tensor_cost.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "converter/convert.h"
#include "kernels/half.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

ConvertReport ReportOf(const Bundle& bundle, Precision precision, std::span<const Sequence> motion) {
  const ConvertOptions options{.precision = precision, .motion = motion};
  return Convert(bundle, options).report;
}
const TensorReport& Find(const ConvertReport& report, const std::string& name) {
  return *std::find_if(report.tensors.begin(), report.tensors.end(),
                       [&](const TensorReport& tensor) { return tensor.name == name; });
}

// The coefficients' weights underflow as halves, and a basis as much larger makes up for them: in f32 the
// same network, in fp16 the whole mesh stage is lost by this one tensor.
TEST(TensorCostTest, ThePoisonedTensorRanksFirst) {
  Bundle bundle = ParseBundle({});
  const std::vector<Sequence> motion = {ParseSequence({}, 12)};
  const ConvertReport healthy = ReportOf(bundle, Precision::kFp16, motion);
  const std::string poisoned = "mesh_stage.coefficients.weights";
  MeshWeights& mesh = *bundle.mesh;
  const float shrink = 2e-8f / mesh.coefficients.weight.cwiseAbs().maxCoeff();  // half of the smallest half is 3e-8
  mesh.coefficients.weight *= shrink;
  // The hidden layer takes a part of the rest (a ReLU lets positive factors through), so that all stay below
  // 65504.
  constexpr float kHidden = 1e3f;
  mesh.hidden.weight *= kHidden;
  mesh.hidden.bias *= kHidden;
  mesh.coefficients.bias *= shrink * kHidden;
  mesh.basis *= 1 / (shrink * kHidden);
  ASSERT_LT(mesh.basis.cwiseAbs().maxCoeff(), kernels::kMaxHalf);

  const ConvertReport report = ReportOf(bundle, Precision::kFp16, motion);
  const std::vector<const TensorReport*> ranked = RankByCost(report.tensors);
  ASSERT_GE(ranked.size(), 7u);
  EXPECT_EQ(ranked[0]->name, poisoned);
  EXPECT_EQ(ranked[0]->loss.zeroed, static_cast<uint64_t>(mesh.coefficients.weight.size()));
  EXPECT_GT(ranked[0]->cost->mean_mm, 10 * ranked[1]->cost->mean_mm);
  for (size_t i = 1; i < ranked.size(); ++i) EXPECT_LE(ranked[i]->cost->mean_mm, ranked[i - 1]->cost->mean_mm);
  EXPECT_LT(Find(healthy, poisoned).cost->mean_mm, 0.01 * ranked[0]->cost->mean_mm);
}

// With one lossy tensor its cost is that of the model, and exact tensors cost nothing.
TEST(TensorCostTest, OneLossyTensorCostsWhatTheModelCosts) {
  const BundleSpec spec{.skeleton = false, .mesh = false};
  Bundle bundle = ParseBundle(spec);
  for (float& weight : bundle.static_hidden.weight.reshaped())
    weight = kernels::FloatFromHalf(kernels::HalfFromFloat(weight));
  const ConvertReport report = ReportOf(bundle, Precision::kFp16, std::vector<Sequence>{ParseSequence(spec, 9)});
  const std::vector<const TensorReport*> ranked = RankByCost(report.tensors);
  ASSERT_EQ(ranked.size(), 2u);
  EXPECT_EQ(ranked[0]->name, "static_stage.increments.weights");
  ASSERT_GT(report.trials[0].error.position_mm.mean, 0);
  EXPECT_EQ(ranked[0]->cost->mean_mm, report.trials[0].error.position_mm.mean);
  EXPECT_EQ(ranked[0]->cost->p99_mm, report.trials[0].error.position_mm.p99);
  EXPECT_EQ(ranked[1]->cost->max_mm, 0);
  EXPECT_EQ(ranked[1]->loss.snr_db, INFINITY);
}

TEST(TensorCostTest, MeasuredOnMotionOnlyAndForLossyTensorsOnly) {
  const Bundle bundle = ParseBundle({});
  for (const TensorReport& tensor : ReportOf(bundle, Precision::kInt8, {}).tensors) EXPECT_FALSE(tensor.cost);
  const std::vector<Sequence> motion = {ParseSequence({}, 5)};
  EXPECT_TRUE(RankByCost(ReportOf(bundle, Precision::kFp32, motion).tensors).empty());

  size_t calls = 0, last = 0, total = 0;
  ConvertOptions options{.precision = Precision::kInt8, .motion = motion};
  options.progress = [&](size_t done, size_t all) {
    EXPECT_EQ(done, last + 1);
    ++calls, last = done, total = all;
  };
  const ConvertReport report = Convert(bundle, options).report;
  size_t lossy = 0;
  for (const TensorReport& tensor : report.tensors) {
    const bool stored_smaller = tensor.dtype == "i8" || tensor.dtype == "f16";
    EXPECT_EQ(tensor.cost.has_value(), stored_smaller) << tensor.name;
    lossy += stored_smaller ? 1 : 0;
  }
  EXPECT_EQ(lossy,
            7u);  // two of the static stage, two of the skeleton stage, two of the mesh stage, the basis
  EXPECT_EQ(calls, 5 * (lossy + 1));
  EXPECT_EQ(total, calls);
}

}  // namespace
}  // namespace dcloth::converter
