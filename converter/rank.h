// How many rows the displacement basis of a model gets.
#ifndef DCLOTH_CONVERTER_RANK_H_
#define DCLOTH_CONVERTER_RANK_H_

#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "converter/assemble.h"
#include "converter/reduce.h"
#include "converter/sequence.h"

namespace dcloth::converter {

enum class RankMode : uint8_t {
  kExact,   // the numerical rank, where that saves bytes; else as it is
  kFull,    // as it is: S above M
  kFixed,   // so many rows, or the numerical rank where that is less
  kSearch,  // the fewest rows within the error bound on the calibration motion
};

struct RankRequest {
  RankMode mode = RankMode::kExact;
  uint32_t rank = 0;  // of kFixed
};

// Makes bases of any rank for one bundle; what is costly is made once, and only when a rank needs it.
class RankMaker {
 public:
  // Without `calibration` no rank below the numerical one is made. All arguments outlive it.
  RankMaker(const Bundle& bundle, const FoldedBundle& folded, std::span<const Sequence> calibration);

  uint32_t full_rows() const;   // k_S + k_M; 0 without a skeleton stage
  uint32_t exact_rank() const;  // the numerical rank, even
  bool ExactSaves(Precision precision);

  // `rank` is even, 2 to exact_rank(), or kFullRank for no reduction. For int8 some rows are remainders (correct.h):
  // with calibration as many of `rank` rows as lower the error, without it as many on top of them as keep the rounding
  // of the whole basis. Throws Error.
  std::optional<ReducedBasis> Make(uint32_t rank, Precision precision);
  static constexpr uint32_t kFullRank = 0;

 private:
  const Bundle& bundle_;
  const FoldedBundle& folded_;
  std::span<const Sequence> calibration_;
  std::optional<BasisRank> basis_;
  std::optional<BasisFrame> frame_;
  MatrixD moment_;
};

// The smallest even rank from 2 to `top` for which `good` holds, found by halving: error falls as rank grows, but for
// the rounding of what is stored. `top` is known to be good. Cost: log2(top) calls.
uint32_t SmallestGoodRank(uint32_t top, const std::function<bool(uint32_t rank)>& good);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_RANK_H_
