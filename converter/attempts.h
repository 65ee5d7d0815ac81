// Models of one bundle, tried one after another against the error bound.
#ifndef DCLOTH_CONVERTER_ATTEMPTS_H_
#define DCLOTH_CONVERTER_ATTEMPTS_H_

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "converter/assemble.h"
#include "converter/convert.h"
#include "converter/error.h"
#include "converter/rollout.h"

namespace dcloth::converter {

struct Candidate {
  PrecisionPlan plan;
  AlignedBytes bytes;
  std::vector<TensorReport> tensors;
  uint32_t rank = RankMaker::kFullRank;
  uint32_t rows = 0;                    // of a reduced basis, remainders among them
  std::optional<ReducedBasis> reduced;  // what FoldedBundle::reduced was
  PrunedWeights skin;                   // and FoldedBundle::skin
};

// What errors are against: float32, nothing reduced. Throws Error.
OpenModel ReferenceModel(const Bundle& bundle, const FoldedBundle& folded);

class Attempts {
 public:
  // All arguments outlive it; `reference` is null where there is nothing to measure on. Every measured attempt is added
  // to `trials`.
  Attempts(const Bundle& bundle, const FoldedBundle& folded, const ConvertOptions& options, const OpenModel* reference,
           RankMaker* ranks, std::vector<Trial>* trials)
      : bundle_(bundle), folded_(folded), options_(options), reference_(reference), ranks_(ranks), trials_(trials) {}

  // Whether the asked-for rank, or the best one, keeps the bound in these formats; found() is then that model. Throws
  // Error.
  bool Settle(const PrecisionPlan& plan);
  // The same in the cheapest formats that keep it; these are chosen at the exact rank, a search for fewer rows then
  // takes what they leave of the bound, and fewer bones a vertex what that leaves. Throws Error.
  bool SettleFormats(AutoReport* report);
  Candidate& found() { return found_; }

  // The last attempt as an error: what it was off by, where, and what to do.
  ThresholdError Missed() const;

 private:
  enum class On : uint8_t { kAll, kCalibration };

  bool Try(const PrecisionPlan& plan, uint32_t rank, On on);
  bool Search(const PrecisionPlan& plan);
  bool ChooseAt(uint32_t rank, AutoReport* report);
  void PruneInfluences(AutoReport* report);
  bool Within(const MeshError& error) const;
  Candidate Write(const PrecisionPlan& plan, uint32_t rank) const;
  uint32_t FixedRank() const;

  const Bundle& bundle_;
  const FoldedBundle& folded_;
  const ConvertOptions& options_;
  const OpenModel* reference_;
  RankMaker* ranks_;
  std::vector<Trial>* trials_;
  Candidate found_;
  PrecisionPlan chosen_;               // of ChooseAt
  std::optional<PrunedWeights> skin_;  // in place of folded_'s
};

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_ATTEMPTS_H_
