#include "converter/rank.h"

#include <Eigen/Core>
#include <algorithm>

#include "converter/calibrate.h"
#include "converter/correct.h"
#include "converter/error.h"
#include "converter/fold.h"
#include "converter/weight_place.h"

namespace dcloth::converter {
namespace {

// Of the whole basis' squared rounding error. Both are estimated for independent coefficients, but real ones favour the
// strong directions, which are few rows now: at an equal estimate the bundled skirt was off by 0.20 mm instead of
// 0.125.
constexpr double kRoundingShare = 0.25;

// One row in so many has its remainder stored at most: an int8 model stays below 0.30 of its fp32 twin.
constexpr size_t kRowsPerCorrection = 20;

}  // namespace

RankMaker::RankMaker(const Bundle& bundle, const FoldedBundle& folded, std::span<const Sequence> calibration)
    : bundle_(bundle), folded_(folded), calibration_(calibration) {
  if (bundle.skeleton) basis_.emplace(bundle);
}

uint32_t RankMaker::full_rows() const { return basis_ ? basis_->rows() : 0; }

uint32_t RankMaker::exact_rank() const { return basis_ ? StoredRank(basis_->rank()) : 0; }

bool RankMaker::ExactSaves(Precision precision) {
  if (!basis_ || basis_->rank() >= basis_->rows()) return false;
  const ReducedBasis reduced = *Make(exact_rank(), precision);
  const size_t rows = static_cast<size_t>(reduced.basis.rows()) + reduced.corrected.size();
  return ReductionSaves(bundle_, static_cast<uint32_t>(rows), precision);
}

std::optional<ReducedBasis> RankMaker::Make(uint32_t rank, Precision precision) {
  if (rank == kFullRank) return std::nullopt;
  if (!frame_) {
    frame_ = basis_->Frame();
    moment_ = ExpectedMoment(*frame_);
    if (!calibration_.empty()) {
      const MatrixD measured = DisplacementMoment(bundle_, folded_, *frame_, calibration_);
      const double trace = moment_.trace();
      moment_ = measured + (trace > 0 ? kExpectedShare * measured.trace() / trace : 1.0) * moment_;
    }
  }
  ReducedBasis reduced = Reduce(bundle_, *frame_, moment_, std::min(rank, frame_->rank()));
  if (precision != Precision::kInt8) return reduced;
  try {
    if (calibration_.empty()) {
      const QuantizedMatrix whole = QuantizeTwoSided("displacement.basis.weights", StackBasis(bundle_).basis);
      const auto rows = static_cast<size_t>(reduced.basis.rows());
      AddCorrections(kRoundingShare * whole.squared_error, rows / kRowsPerCorrection, &reduced);
    } else {
      TradeForCorrections(&reduced);
    }
  } catch (const Error& error) {
    RethrowForBundle(error, bundle_);
  }
  return reduced;
}

uint32_t SmallestGoodRank(uint32_t top, const std::function<bool(uint32_t rank)>& good) {
  uint32_t bad = 0, best = top;
  while (best - bad > 2) {
    const uint32_t middle = (bad + best) / 4 * 2;
    (good(middle) ? best : bad) = middle;
  }
  return best;
}

}  // namespace dcloth::converter
