// Corrected rows: what int8 takes from a reduced basis' strongest rows, given back by further rows.
//
// A displacement lives in a few strong directions and many weak ones, and every int8 row loses the same part of its own
// size: nearly all of the loss is in the strong rows. A row's remainder after rounding, stored as one more int8 row
// with the same coefficient, makes its error 254 times smaller. At equal size that buys far more than the weakest
// direction: of 128 int8 rows of the bundled skirt (error 0.19 mm), 96 directions and 16 remainders take only 112
// (0.045 mm).
#ifndef DCLOTH_CONVERTER_CORRECT_H_
#define DCLOTH_CONVERTER_CORRECT_H_

#include <cstdint>
#include <span>
#include <string>

#include "converter/quantize.h"
#include "converter/reduce.h"

namespace dcloth::converter {

// Keeps the number of rows: drops the weakest pair of directions for the remainders of the two rows that round worst,
// as long as rounding loses more than the directions carry.
void TradeForCorrections(ReducedBasis* reduced);

// Adds remainders, worst rows first and in pairs, until rounding loses no more than `squared_error` or `most` rows have
// one.
void AddCorrections(double squared_error, size_t most, ReducedBasis* reduced);

// int8 rows of `basis`, then the remainders of the rows `corrected`. `exact` is what those rows stand for.
struct CorrectedMatrix {
  QuantizedMatrix stored;
  Matrix exact;
};
CorrectedMatrix QuantizeCorrected(const std::string& name, const Matrix& basis, std::span<const uint32_t> corrected);

// A remainder has the coefficient of its row: the head's columns and the mesh stage's outputs again.
Matrix HeadWithCopies(const ReducedBasis& reduced);
LinearWeights CoefficientsWithCopies(const ReducedBasis& reduced);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_CORRECT_H_
