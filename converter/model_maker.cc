#include "converter/model_maker.h"

#include <utility>

#include "converter/error.h"
#include "converter/weight_place.h"
#include "converter/write_model.h"

namespace dcloth::converter {
namespace {

constexpr uint32_t kInfluences = 8;  // as ConvertOptions has them

}  // namespace

WrittenModel WriteRanked(const Bundle& bundle, RankMaker* ranks, uint32_t rank, const PrecisionPlan& plan,
                         FoldedBundle* folded) {
  try {
    folded->reduced.reset();
    if (ranks != nullptr) folded->reduced = ranks->Make(rank, FormatOf(plan, "displacement.basis"));
    const ModelParts parts = Assemble(bundle, *folded, plan);
    WrittenModel model{WriteModel(parts), {}, folded->reduced ? parts.skeleton_rows : 0};
    for (const PackedTensor* tensor : TensorsOf(parts)) model.tensors.push_back(tensor->report);
    return model;
  } catch (const Error& error) {
    RethrowForBundle(error, bundle);
  }
}

ModelMaker::ModelMaker(const Bundle& bundle, std::span<const Sequence> calibration)
    : bundle_(bundle), folded_(FoldBundle(bundle, kInfluences, kInfluences)), ranks_(bundle, folded_, calibration) {}

uint32_t ModelMaker::DefaultRank(Precision precision) {
  return ranks_.ExactSaves(precision) ? ranks_.exact_rank() : RankMaker::kFullRank;
}

MadeModel ModelMaker::Make(Precision precision, uint32_t rank) {
  WrittenModel written = WriteRanked(bundle_, &ranks_, rank, {precision, {}, {}}, &folded_);
  const uint32_t rows = rank == RankMaker::kFullRank ? full_rows() : written.rows;
  return {OpenModel(std::move(written.bytes), bundle_.path), rows};
}

}  // namespace dcloth::converter
