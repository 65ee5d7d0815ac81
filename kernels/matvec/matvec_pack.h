// Packs matrices into the layouts that matvec.h reads. Offline: plain loops, caller's memory.
//
// The source element (j, c) lies at source[j * row_stride + c * column_stride], so that a PyTorch weight [out, in]
// packs with row_stride 1 and column_stride `in`. Padding (columns up to a multiple of 32, an odd matrix's last row) is
// zero.
#ifndef DCLOTH_KERNELS_MATVEC_MATVEC_PACK_H_
#define DCLOTH_KERNELS_MATVEC_MATVEC_PACK_H_

#include <cstddef>
#include <cstdint>

#include "kernels/matvec/matvec.h"

namespace dcloth::kernels {

// Elements of a packed matrix, padding included.
constexpr size_t PanelElements(size_t rows, size_t columns) { return PaddedColumns(columns) * rows; }
constexpr size_t PairPanelElements(size_t rows, size_t columns) { return PaddedColumns(columns) * PairedRows(rows); }

struct MatrixShape {
  size_t rows;
  size_t columns;
  size_t row_stride;     // elements
  size_t column_stride;  // elements
};

void PackPanelsF32(const float* source, const MatrixShape& shape, float* packed);

// Rounds to nearest even; magnitudes from 65520 up become infinity.
void PackPanelsF16(const float* source, const MatrixShape& shape, uint16_t* packed);

void PackPairPanelsI8(const int8_t* source, const MatrixShape& shape, int8_t* packed);

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_MATVEC_MATVEC_PACK_H_
