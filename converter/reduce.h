// The stacked basis [S; M] in fewer rows (engine/format/NETWORK.md, "Reduced basis").
#ifndef DCLOTH_CONVERTER_REDUCE_H_
#define DCLOTH_CONVERTER_REDUCE_H_

#include <cstdint>
#include <vector>

#include "converter/bundle.h"
#include "converter/precision.h"

namespace dcloth::converter {

// The directions that the rows of A = [S; M] (k_S + k_M of them, without padding) really use.
struct BasisFrame {
  MatrixD directions;   // Y [r, 3n], orthonormal rows; r is the numerical rank of A
  MatrixD coordinates;  // X = A Y^T [k_S + k_M, r]: A = X Y but for rounding

  uint32_t rank() const { return static_cast<uint32_t>(coordinates.cols()); }
};

// The numerical rank of A: the smallest r directions that keep all of every row but a `tolerance` of its length that
// its own numbers leave open. That is 2^-11, half a unit in the last place, for a matrix whose elements are all half
// floats, and never below sqrt(k_S + k_M) 2^-24, by which a float sum over the rows rounds anyway.
class BasisRank {
 public:
  // Above this many rows eigenvectors take minutes: rank() is rows() then, and Frame() throws Error.
  static constexpr uint32_t kMostRows = 2048;

  // `bundle` has a skeleton stage. Cost: (k_S + k_M)^2 3n / 2 multiply-adds.
  explicit BasisRank(const Bundle& bundle);

  uint32_t rows() const { return rows_; }
  uint32_t rank() const { return rank_; }

  // Cost: 2 (k_S + k_M) rank 3n multiply-adds.
  BasisFrame Frame() const;

 private:
  const Bundle& bundle_;
  uint32_t rows_, rank_;
  MatrixD weights_;  // [rows, rank]: combinations of A's rows that make the directions
};

// A model's displacement with a head, as fold.h and pack.h take them.
struct ReducedBasis {
  Matrix basis;                // B [rank, 3n]
  Matrix head;                 // H_S [k_S, rank]
  LinearWeights coefficients;  // W_2 and b_2 times H_M: [rank, h], [rank]; empty without a mesh stage
  // Rows whose int8 remainder is stored as a row of its own behind the others (correct.h); ignored by floats.
  std::vector<uint32_t> corrected;
};

// Rows are stored in pairs, so a rank is even: the next even one, which may add a row of zeros.
constexpr uint32_t StoredRank(uint32_t rank) { return rank + rank % 2; }

// The `rank` directions that carry the most of `moment` [r, r], the second moment of displacements in the frame's
// coordinates, strongest first. Each is scaled to the root of what it carries, so that coefficients have mean square 1
// and the rows' sizes tell their weight: two-sided int8 scales then lose least where it counts. rank is from 1 to
// frame.rank(); the result has StoredRank(rank) rows.
ReducedBasis Reduce(const Bundle& bundle, const BasisFrame& frame, const MatrixD& moment, uint32_t rank);

// X^T X: what to expect of displacements without having seen any, all coefficients independent and of size 1.
MatrixD ExpectedMoment(const BasisFrame& frame);

// How much of the expected moment goes into a measured one, of its trace. Directions that calibration motion did not
// use are not worthless: kept at 0.01, a basis cut to a third and calibrated on one clip was off by 0.46 mm instead
// of 1.5 on another, and one calibrated on twelve clips by 0.244 instead of 0.233 (bundled skirt, 64 of 192 rows).
constexpr double kExpectedShare = 0.01;

// The head is never below fp16, as every displacement goes through it: int8 would save 8 KB of the bundled skirt's 6
// MB.
constexpr Precision HeadPrecision(Precision precision) {
  return precision == Precision::kInt8 ? Precision::kFp16 : precision;
}

// Whether `rank` rows with their head and wider mesh stage are fewer bytes than the basis as it is.
bool ReductionSaves(const Bundle& bundle, uint32_t rank, Precision precision);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_REDUCE_H_
