// Matrix-vector products y[c] = sum_j x[j] W[j][c] + bias[c] over weights in panels of 32 columns: the displacement
// basis, the GRU's products and every MLP; and the same for many vectors at once. Layouts: engine/format/dcloth.fbs
// ("panels", "pair panels"); packing: matvec_pack.h.
//
// Contract of all jobs: `weights` and `column_scales` start on 64 bytes, everything else on its element's width.
// Nothing is read outside the ranges named here and nothing is written outside y. y overlaps no input, except that bias
// may be y: products add up. Values are finite.
#ifndef DCLOTH_KERNELS_MATVEC_MATVEC_H_
#define DCLOTH_KERNELS_MATVEC_MATVEC_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

constexpr size_t kPanelColumns = 32;

constexpr size_t PanelCount(size_t columns) { return (columns + kPanelColumns - 1) / kPanelColumns; }
constexpr size_t PaddedColumns(size_t columns) { return PanelCount(columns) * kPanelColumns; }
constexpr size_t PairedRows(size_t rows) { return rows + (rows & 1); }

// in_order: products and sums are rounded apart, from the first row to the last: bit-identical on every instruction
// set, and somewhat slower where the weights are in the cache.
//
// Which rows of the stored matrix take part: the first row_count of `panel_rows` stored ones, so that the stages in use
// take their part of a shared basis. row_count 0 gives the bias.
struct MatvecF32Job {
  const float* x;        // [row_count]
  const float* weights;  // [panel_count][panel_rows][32]
  const float* bias;     // [panel_count * 32], or null for zero
  float* y;              // [panel_count * 32]
  size_t panel_rows;
  size_t row_count;
  size_t panel_count;  // PanelCount(columns)
  bool relu;           // y = max(y, 0)
  bool in_order = false;
};

// Weights are IEEE binary16, converted exactly (subnormals too); arithmetic is f32.
struct MatvecF16Job {
  const float* x;
  const uint16_t* weights;
  const float* bias;
  float* y;
  size_t panel_rows;
  size_t row_count;
  size_t panel_count;
  bool relu;
  bool in_order = false;
};

// y[c] = (float(sum_j x[j] W[j][c]) * x_scale) * column_scales[c] + bias[c]; the sum is exact in int32 where x comes
// from QuantizeI16. panel_rows and row_count are even. Bit-identical on every instruction set.
struct MatvecI8Job {
  const int16_t* x;            // [row_count]
  const int8_t* weights;       // [panel_count][panel_rows / 2][32][2]
  const float* column_scales;  // [panel_count * 32]
  const float* bias;           // [panel_count * 32], or null for zero
  float* y;                    // [panel_count * 32]
  float x_scale;
  size_t panel_rows;
  size_t row_count;
  size_t panel_count;
  bool relu;
};

// MatvecI8 for `count` inputs at once, with its bits: y[i][c] = (float(sum_j x[i][j] W[j][c]) * x_scales[i]) *
// column_scales[c] + bias[c]. The weights are read once for all inputs. The rows of x and of y lie x_stride and
// y_stride elements apart; what lies between them is neither read nor written. bias is not y.
struct MatmulI8Job {
  const int16_t* x;            // [count] rows of [row_count]
  const float* x_scales;       // [count]
  const int8_t* weights;       // [panel_count][panel_rows / 2][32][2]
  const float* column_scales;  // [panel_count * 32]
  const float* bias;           // [panel_count * 32], or null for zero
  float* y;                    // [count] rows of [panel_count * 32]
  size_t count;
  size_t x_stride;  // at least row_count
  size_t y_stride;  // at least panel_count * 32
  size_t panel_rows;
  size_t row_count;
  size_t panel_count;
  bool relu;
};

// q[j] = round(x[j] * row_scales[j] / *scale) with the smallest scale of 1, 5/4, 6/4 or 7/4 times a power of two such
// that no int32 sum of MatvecI8 can overflow, whatever the weights: |q[j]| <= 32767 and 128 * sum_j |q[j]| < 2^31
// (conservatively, see quantize.h). The quotient is a product with the inverse: off by 2^-22 of itself at most.
// q[rows] = 0 where rows is odd. All-zero x gives scale 1; a product that is not finite counts as 0.
// Bit-identical on every instruction set.
struct QuantizeI16Job {
  const float* x;           // [rows]
  const float* row_scales;  // [rows], or null for one
  int16_t* q;               // [PairedRows(rows)]
  float* scale;             // written
  size_t rows;              // at most kMaxQuantizedRows
};

constexpr size_t kMaxQuantizedRows = size_t{1} << 20;

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_MATVEC_MATVEC_H_
