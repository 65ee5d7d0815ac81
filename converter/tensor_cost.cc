#include "converter/tensor_cost.h"

#include <algorithm>
#include <tuple>

#include "converter/metrics.h"
#include "converter/rollout.h"
#include "converter/write_model.h"

namespace dcloth::converter {
namespace {

struct Variant {
  TensorReport* report;
  OpenModel model;
  ErrorMeter meter;
};

OpenModel ModelOf(const Bundle& bundle, const FoldedBundle& folded, const PrecisionPlan& plan) {
  return OpenModel(WriteModel(Assemble(bundle, folded, plan)), bundle.path);
}

}  // namespace

void MeasureTensorCosts(const Bundle& bundle, const FoldedBundle& folded, const PrecisionPlan& plan,
                        std::span<const Sequence> motion, std::vector<TensorReport>* tensors,
                        const ProgressCallback& progress) {
  if (motion.empty()) return;
  const OpenModel reference = ModelOf(bundle, folded, {});
  const size_t floats = size_t{reference.info().vertex_count} * 3;
  std::vector<Variant> variants;
  for (TensorReport& tensor : *tensors) {
    if (tensor.dtype != "f16" && tensor.dtype != "i8") continue;
    PrecisionPlan alone = plan;
    alone.only = tensor.name;
    variants.push_back(
        {&tensor, ModelOf(bundle, folded, alone), ErrorMeter(reference.triangles(), reference.info().vertex_count)});
  }
  size_t done = 0, total = 0;
  for (const Sequence& sequence : motion) total += sequence.frame_count * (variants.size() + 1);
  const auto step = [&] {
    ++done;
    if (progress) progress(done, total);
  };
  const uint32_t stages = reference.info().stages;
  for (const Sequence& sequence : motion) {
    std::vector<float> expected;
    expected.reserve(sequence.frame_count * floats);
    Rollout(reference, sequence, stages, [&](size_t, std::span<const float> positions, std::span<const float>) {
      expected.insert(expected.end(), positions.begin(), positions.end());
      step();
    });
    for (Variant& variant : variants) {
      Rollout(variant.model, sequence, stages,
              [&](size_t frame, std::span<const float> positions, std::span<const float>) {
                variant.meter.AddFrame(positions, std::span(expected).subspan(frame * floats, floats));
                step();
              });
    }
  }
  for (const Variant& variant : variants) {
    const PositionError error = variant.meter.Result().position_mm;
    variant.report->cost = TensorCost{error.mean, error.p99, error.max};
  }
}

std::vector<const TensorReport*> RankByCost(std::span<const TensorReport> tensors) {
  std::vector<const TensorReport*> ranked;
  for (const TensorReport& tensor : tensors) {
    if (tensor.cost) ranked.push_back(&tensor);
  }
  std::sort(ranked.begin(), ranked.end(), [](const TensorReport* a, const TensorReport* b) {
    return std::tie(b->cost->mean_mm, a->name) < std::tie(a->cost->mean_mm, b->name);
  });
  return ranked;
}

}  // namespace dcloth::converter
