#include "kernels/matvec/matvec_pack.h"

#include "kernels/half.h"

namespace dcloth::kernels {
namespace {

// Writes the elements in the order of the layout: `group` rows interleaved, zero outside the matrix.
template <typename Source, typename Packed, typename Convert>
void Pack(const Source* source, const MatrixShape& shape, size_t group, Packed* packed, Convert convert) {
  const size_t padded_rows = group == 2 ? PairedRows(shape.rows) : shape.rows;
  for (size_t panel = 0; panel < PanelCount(shape.columns); ++panel) {
    for (size_t first = 0; first < padded_rows; first += group) {
      for (size_t c = 0; c < kPanelColumns; ++c) {
        const size_t column = panel * kPanelColumns + c;
        for (size_t row = first; row < first + group; ++row) {
          const bool inside = row < shape.rows && column < shape.columns;
          *packed++ = inside ? convert(source[row * shape.row_stride + column * shape.column_stride]) : Packed{0};
        }
      }
    }
  }
}

}  // namespace

void PackPanelsF32(const float* source, const MatrixShape& shape, float* packed) {
  Pack(source, shape, 1, packed, [](float value) { return value; });
}

void PackPanelsF16(const float* source, const MatrixShape& shape, uint16_t* packed) {
  Pack(source, shape, 1, packed, [](float value) { return HalfFromFloat(value); });
}

void PackPairPanelsI8(const int8_t* source, const MatrixShape& shape, int8_t* packed) {
  Pack(source, shape, 2, packed, [](int8_t value) { return value; });
}

}  // namespace dcloth::kernels
