#include "converter/attempts.h"

#include <algorithm>
#include <string>
#include <utility>

namespace dcloth::converter {
namespace {

// The engine has the last word on what is a model.
OpenModel Open(const AlignedBytes& bytes, const Bundle& bundle) {
  try {
    return OpenModel(bytes, bundle.path);
  } catch (const Error& error) {
    throw Error({bundle.path, "", "a model that the engine refuses: " + error.parts().found, "",
                 "make the network smaller where a limit is named; else this is a fault of the converter, report it"});
  }
}

uint32_t StoredRows(const ModelParts& parts, uint32_t rank) {
  return rank == RankMaker::kFullRank ? 0 : parts.skeleton_rows;
}

std::string Millimetres(double value) { return std::to_string(value) + " mm"; }

}  // namespace

Attempts::Attempts(const Bundle& bundle, const FoldedBundle& folded, const ConvertOptions& options, RankMaker* ranks,
                   std::vector<Trial>* trials)
    : bundle_(bundle), folded_(folded), options_(options), ranks_(ranks), trials_(trials) {
  if (options.motion.empty() && options.calibration.empty()) return;
  reference_.emplace(Open(Write(Precision::kFp32, RankMaker::kFullRank).bytes, bundle));
}

Candidate Attempts::Write(Precision precision, uint32_t rank) const {
  try {
    FoldedBundle folded = folded_;
    folded.reduced = ranks_->Make(rank, precision);
    const ModelParts parts = Assemble(bundle_, folded, {precision, {}});
    Candidate candidate{WriteModel(parts), {}, rank, StoredRows(parts, rank), std::move(folded.reduced)};
    for (const PackedTensor* tensor : TensorsOf(parts)) candidate.tensors.push_back(tensor->report);
    return candidate;
  } catch (const Error& error) {
    if (!error.parts().path.empty()) throw;
    ErrorParts parts = error.parts();
    parts.path = bundle_.path;
    throw Error(std::move(parts));
  }
}

bool Attempts::Within(const MeshError& error) const {
  return !options_.max_error_mm || error.position_mm.max <= *options_.max_error_mm;
}

bool Attempts::Try(Precision precision, uint32_t rank, On on) {
  Candidate candidate = Write(precision, rank);
  const OpenModel model = Open(candidate.bytes, bundle_);
  bool good = true;
  if (reference_) {
    Trial trial{precision, candidate.bytes.size(), {}, candidate.rows, {}};
    if (rank == RankMaker::kFullRank) trial.rank = ranks_->full_rows();
    if (!options_.calibration.empty()) {
      trial.calibration = trial.error = CompareModels(model, *reference_, options_.calibration);
      good = Within(trial.calibration);
    }
    if (on == On::kAll && !options_.motion.empty()) {
      trial.error = CompareModels(model, *reference_, options_.motion);
      good = good && Within(trial.error);
    }
    trials_->push_back(std::move(trial));
  }
  if (good) found_ = std::move(candidate);
  return good;
}

bool Attempts::Search(Precision precision) {
  const auto good = [&](uint32_t rank) { return Try(precision, rank, On::kCalibration); };
  const uint32_t top = ranks_->exact_rank();
  if (top == 0 || !good(top)) return Try(precision, RankMaker::kFullRank, On::kAll);
  const uint32_t rank = SmallestGoodRank(top, good);
  return options_.motion.empty() || Try(precision, rank, On::kAll);
}

uint32_t Attempts::FixedRank() const {
  const uint32_t asked = StoredRank(options_.rank.rank), exact = ranks_->exact_rank();
  if (exact == 0) {
    throw Error({bundle_.path, "", "no displacement basis, as there is no skeleton stage", "one to reduce",
                 "leave --rank out"});
  }
  if (asked < exact && options_.calibration.empty()) {
    throw Error({bundle_.path, "",
                 "a rank of " + std::to_string(options_.rank.rank) + ", below the basis' own " +
                     std::to_string(exact) + ", and no motion to tell what may go",
                 "motion to weigh directions by", "pass --calibrate SEQ, once or more"});
  }
  return std::min(asked, exact);
}

bool Attempts::Settle(Precision precision) {
  switch (options_.rank.mode) {
    case RankMode::kFull:
      return Try(precision, RankMaker::kFullRank, On::kAll);
    case RankMode::kFixed:
      return Try(precision, FixedRank(), On::kAll);
    case RankMode::kSearch:
      return Search(precision);
    case RankMode::kExact:
      break;
  }
  // An exact rank still rounds: where that is more than the bound leaves, the basis stays.
  if (ranks_->ExactSaves(precision) && Try(precision, ranks_->exact_rank(), On::kAll)) return true;
  return Try(precision, RankMaker::kFullRank, On::kAll);
}

ThresholdError Attempts::Missed() const {
  const Trial& last = trials_->back();
  const bool unseen = last.calibration.frame_count != 0 && Within(last.calibration);
  const MeshError& error = unseen || last.calibration.frame_count == 0 ? last.error : last.calibration;
  const bool reduced = last.rank != ranks_->full_rows();
  std::string mend = "raise --max-error-mm";
  if (unseen) {
    mend += ", or calibrate on motion of that kind too";
  } else if (options_.rank.mode == RankMode::kFixed) {
    mend += " or --rank";
  }
  if (options_.precision) mend += ", or pass --precision auto";
  return ThresholdError({bundle_.path, "",
                         std::string(PrecisionName(last.precision)) +
                             (reduced ? " of rank " + std::to_string(last.rank) : "") +
                             " to differ from fp32 by up to " + Millimetres(error.position_mm.max) +
                             (unseen ? " on motion that it was not calibrated on" : ""),
                         "at most " + Millimetres(*options_.max_error_mm), mend});
}

}  // namespace dcloth::converter
