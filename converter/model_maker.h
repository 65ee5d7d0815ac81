// Models of one bundle at any precision and rank, without a bound to meet; what they share is made once.
#ifndef DCLOTH_CONVERTER_MODEL_MAKER_H_
#define DCLOTH_CONVERTER_MODEL_MAKER_H_

#include <cstdint>
#include <span>
#include <vector>

#include "converter/assemble.h"
#include "converter/bundle.h"
#include "converter/precision.h"
#include "converter/rank.h"
#include "converter/rollout.h"
#include "converter/sequence.h"

namespace dcloth::converter {

// What the converter writes of one bundle, with the reports of its tensors.
struct WrittenModel {
  AlignedBytes bytes;
  std::vector<TensorReport> tensors;
  uint32_t rows = 0;  // of a reduced basis, remainders among them; 0 where it is not reduced
};

// `rank` is what RankMaker::Make takes; the reduced basis made from it is left in `folded`. Without `ranks`, which may
// be null then, the basis is the whole one. Throws Error that names the bundle.
WrittenModel WriteRanked(const Bundle& bundle, RankMaker* ranks, uint32_t rank, const PrecisionPlan& plan,
                         FoldedBundle* folded);

struct MadeModel {
  OpenModel model;
  uint32_t rows = 0;  // of its displacement basis, without padding where it is not reduced; 0 without a skeleton stage
};

class ModelMaker {
 public:
  // A rank below the numerical one needs `calibration`. Both arguments outlive it.
  ModelMaker(const Bundle& bundle, std::span<const Sequence> calibration);
  ModelMaker(const ModelMaker&) = delete;
  ModelMaker& operator=(const ModelMaker&) = delete;

  uint32_t full_rows() const { return ranks_.full_rows(); }
  uint32_t exact_rank() const { return ranks_.exact_rank(); }
  // What `convert` stores unasked: exact_rank() where that saves bytes, else RankMaker::kFullRank.
  uint32_t DefaultRank(Precision precision);

  // `rank` as RankMaker::Make takes it. Throws Error.
  MadeModel Make(Precision precision, uint32_t rank);

 private:
  const Bundle& bundle_;
  FoldedBundle folded_;
  RankMaker ranks_;
};

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_MODEL_MAKER_H_
