// What storing a matrix in fewer bits did to its numbers.
#ifndef DCLOTH_CONVERTER_LOSS_H_
#define DCLOTH_CONVERTER_LOSS_H_

#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "converter/bundle.h"
#include "converter/quantize.h"

namespace dcloth::converter {

// One outlier is nearly all of a row's signal, and its scale takes what is beside it. So a row's SNR is that of all its
// elements but the largest (one in kElementsPerOutlier, one at least), against their own size.
constexpr size_t kElementsPerOutlier = 64;
constexpr double kLowRowSnrDb = 26;  // a twentieth of those elements' size is lost; sound int8 rows have 33 or more

struct RowLoss {
  uint32_t row = 0;        // of [rows, columns]: an input, whose loss reaches every output
  double snr_db = 0;       // without its largest elements
  uint32_t low_count = 0;  // rows of the tensor below kLowRowSnrDb
};

struct TensorLoss {
  double lowest = 0, highest = 0;  // of the exact values
  uint64_t clipped = 0;            // elements whose nearest level lies past the last one, so that they lost size
  uint64_t zeroed = 0;             // elements other than zero that are stored as zero
  double relative_rms = 0;         // sqrt(sum (stored - exact)^2 / sum exact^2); 0 where stored exactly
  double relative_max = 0;         // max |stored - exact| / max |exact|
  // 10 log10 (sum exact^2 / sum (stored - exact)^2), dB; infinite where stored exactly.
  double snr_db = std::numeric_limits<double>::infinity();
  // That of the lowest SNR. Rows below a tenth of the median row's size are not looked at; empty where no row loses.
  std::optional<RowLoss> worst_row;
};

// Stored as they are: the range, no loss. An empty span gives zeros.
TensorLoss ExactLoss(std::span<const float> values);

// `stored` [rows, columns] of the same shape as `exact`.
TensorLoss LossOf(const Matrix& exact, const QuantizedMatrix& stored);
TensorLoss LossOf(const Matrix& exact, std::span<const uint16_t> halves);  // row-major binary16

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_LOSS_H_
