#include "converter/attempts.h"

#include <algorithm>
#include <string>
#include <utility>

#include "converter/choose_formats.h"
#include "converter/model_maker.h"
#include "kernels/half.h"

namespace dcloth::converter {
namespace {

constexpr size_t kTrialsPerTensor = 6;  // of choosing formats, about: for the progress line

// Re-opens the bytes with the engine's verifier.
OpenModel Open(const AlignedBytes& bytes, const Bundle& bundle) {
  try {
    return OpenModel(bytes, bundle.path);
  } catch (const Error& error) {
    throw Error(
        {bundle.path, "", "a model that the engine does not open: " + error.parts().found, error.parts().expected,
         "if a limit is named, make the network smaller; otherwise this is a bug in the converter, please report it"});
  }
}

}  // namespace

OpenModel ReferenceModel(const Bundle& bundle, const FoldedBundle& folded) {
  FoldedBundle whole = folded;
  return Open(WriteRanked(bundle, nullptr, RankMaker::kFullRank, {}, &whole).bytes, bundle);
}

Candidate Attempts::Write(const PrecisionPlan& plan, uint32_t rank) const {
  FoldedBundle folded = folded_;
  if (skin_) folded.skin = *skin_;
  WrittenModel written = WriteRanked(bundle_, ranks_, rank, plan, &folded);
  return {plan,         std::move(written.bytes),  std::move(written.tensors), rank,
          written.rows, std::move(folded.reduced), std::move(folded.skin)};
}

bool Attempts::Within(const MeshError& error) const {
  return !options_.max_error_mm || error.position_mm.max <= *options_.max_error_mm;
}

bool Attempts::Try(const PrecisionPlan& plan, uint32_t rank, On on) {
  Candidate candidate = Write(plan, rank);
  const OpenModel model = Open(candidate.bytes, bundle_);
  bool good = true;
  if (reference_ != nullptr) {
    Trial trial{plan.name(), candidate.bytes.size(), {}, candidate.rows, {}};
    if (rank == RankMaker::kFullRank) trial.rank = ranks_->full_rows();
    trial.influences = candidate.skin.influences;
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

bool Attempts::Search(const PrecisionPlan& plan) {
  const auto good = [&](uint32_t rank) { return Try(plan, rank, On::kCalibration); };
  const uint32_t top = ranks_->exact_rank();
  if (top == 0 || !good(top)) return Try(plan, RankMaker::kFullRank, On::kAll);
  const uint32_t rank = SmallestGoodRank(top, good);
  return options_.motion.empty() || Try(plan, rank, On::kAll);
}

bool Attempts::ChooseAt(uint32_t rank, AutoReport* report) {
  const Candidate cheapest = Write({Precision::kInt8, {}}, rank);
  std::vector<FormatOption> options;
  for (const TensorReport& tensor : cheapest.tensors) {
    if (tensor.dtype != "i8" && tensor.dtype != "f16") continue;
    FormatOption option{tensor.name, tensor.dtype == "i8" ? Precision::kInt8 : Precision::kFp16, 1};
    for (const uint32_t extent : tensor.shape) option.element_count *= extent;
    // Half a step of int8 more or less, what half floats hold: rows of a corrected basis differ by so much.
    const double largest = std::max(-tensor.loss.lowest, tensor.loss.highest) * (1 + 1.0 / 127);
    option.has_halves = !IsLayer(tensor.name) && largest < static_cast<double>(kernels::kMaxHalf);
    options.push_back(std::move(option));
  }
  const bool calibrated = !options_.calibration.empty();
  const auto measure = [&](const PrecisionPlan& plan) {
    Try(plan, rank, calibrated ? On::kCalibration : On::kAll);
    const size_t expected = std::max(kTrialsPerTensor * options.size(), trials_->size());
    if (options_.choosing) options_.choosing(trials_->size(), expected);
    return trials_->back().error.position_mm.max;
  };
  std::optional<FormatPlan> chosen = ChooseFormats(options, *options_.max_error_mm, measure);
  if (!chosen) return false;
  report->decisions = std::move(chosen->decisions);
  report->error_mm = chosen->error_mm;
  report->rank = rank == RankMaker::kFullRank ? ranks_->full_rows() : rank;
  chosen_ = std::move(chosen->plan);
  return true;
}

bool Attempts::SettleFormats(AutoReport* report) {
  report->bound_mm = *options_.max_error_mm;
  report->calibrated = !options_.calibration.empty();
  report->checked = report->calibrated && !options_.motion.empty();
  std::vector<uint32_t> ranks = {RankMaker::kFullRank};
  if (options_.rank.mode == RankMode::kFixed) ranks = {FixedRank()};
  const bool exact = options_.rank.mode == RankMode::kSearch
                         ? ranks_->exact_rank() != 0
                         : options_.rank.mode == RankMode::kExact && ranks_->ExactSaves(Precision::kInt8);
  if (exact) ranks.insert(ranks.begin(), ranks_->exact_rank());
  for (const uint32_t rank : ranks) {
    if (!ChooseAt(rank, report)) continue;
    const bool search = options_.rank.mode == RankMode::kSearch && rank != RankMaker::kFullRank;
    const bool good = search ? Search(chosen_) : Try(chosen_, rank, On::kAll);
    if (good) PruneInfluences(report);
    report->measured_models = trials_->size();
    return good;
  }
  return false;
}

void Attempts::PruneInfluences(AutoReport* report) {
  const On choice = options_.calibration.empty() ? On::kAll : On::kCalibration;
  Candidate best = found_;
  size_t kept = trials_->size() - 1;  // the trial of `best`, which ends up last
  while (best.skin.influences > 1) {
    skin_ = Prune(folded_.skin_weights, best.skin.influences - 1);
    if (!Try(best.plan, best.rank, choice)) {
      report->fewer_influences_mm = trials_->back().error.position_mm.max;
      break;
    }
    // What was chosen must hold on motion that the choice did not see, as all else does.
    if (choice == On::kCalibration && !options_.motion.empty() && !Try(best.plan, best.rank, On::kAll)) {
      report->fewer_influences_mm = trials_->back().error.position_mm.max;
      break;
    }
    best = found_;
    kept = trials_->size() - 1;
  }
  report->influences = best.skin.influences;
  found_ = std::move(best);
  skin_.reset();
  const auto from = trials_->begin() + static_cast<std::ptrdiff_t>(kept);
  std::rotate(from, from + 1, trials_->end());
}

uint32_t Attempts::FixedRank() const {
  const uint32_t exact = ranks_->exact_rank(), asked = StoredRank(std::min(options_.rank.rank, exact));
  if (exact == 0) {
    throw Error({bundle_.path, "", "no displacement basis, because there is no skeleton stage", "a basis to reduce",
                 "leave --rank out"});
  }
  if (asked < exact && options_.calibration.empty()) {
    throw Error({bundle_.path, "",
                 "a rank of " + std::to_string(options_.rank.rank) + ", which is below the basis' own rank of " +
                     std::to_string(exact) + ", and no motion",
                 "motion that shows which directions matter", "pass --calibrate SEQ, once or more"});
  }
  return asked;
}

bool Attempts::Settle(const PrecisionPlan& plan) {
  switch (options_.rank.mode) {
    case RankMode::kFull:
      return Try(plan, RankMaker::kFullRank, On::kAll);
    case RankMode::kFixed:
      return Try(plan, FixedRank(), On::kAll);
    case RankMode::kSearch:
      return Search(plan);
    case RankMode::kExact:
      break;
  }
  // An exact rank still rounds: where that is more than the bound leaves, the basis stays.
  if (ranks_->ExactSaves(plan.precision) && Try(plan, ranks_->exact_rank(), On::kAll)) return true;
  return Try(plan, RankMaker::kFullRank, On::kAll);
}

ThresholdError Attempts::Missed() const {
  const Trial& last = trials_->back();
  const bool unseen = last.calibration.frame_count != 0 && Within(last.calibration);
  const MeshError& error = unseen || last.calibration.frame_count == 0 ? last.error : last.calibration;
  const bool reduced = last.rank != ranks_->full_rows();
  std::string mend = "raise --max-error-mm";
  if (unseen && reduced && options_.rank.mode == RankMode::kSearch) {
    mend = "calibrate on motion of that kind too, or pass --rank exact";  // a higher bound leaves fewer rows
  } else if (unseen) {
    mend += ", or calibrate on motion of that kind too";
  } else if (options_.rank.mode == RankMode::kFixed) {
    mend += " or --rank";
  }
  if (options_.stages) mend += ", or keep all stages";
  if (options_.precision) mend += ", or pass --precision auto";
  return ThresholdError({bundle_.path, "",
                         last.precision + (reduced ? " of rank " + std::to_string(last.rank) : "") +
                             " to differ from fp32 by up to " + NumberText(error.position_mm.max) + " mm" +
                             (unseen ? " on motion that it was not calibrated on" : ""),
                         "at most " + NumberText(*options_.max_error_mm) + " mm", mend});
}

}  // namespace dcloth::converter
