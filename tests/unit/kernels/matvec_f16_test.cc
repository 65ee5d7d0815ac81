#include "kernels/half.h"
#include "tests/unit/kernels/matvec_float_test.h"

namespace dcloth::kernels {
namespace {

// Decode rounds as the packing does; that the conversions themselves are exact is half_test's matter.
struct F16 {
  using Job = MatvecF16Job;
  using Weight = uint16_t;
  static void Pack(const float* source, const MatrixShape& shape, uint16_t* packed) {
    PackPanelsF16(source, shape, packed);
  }
  static double Decode(float value) { return FloatFromHalf(HalfFromFloat(value)); }
  static void Run(const KernelTable& table, const MatvecF16Job& job) { table.matvec_f16(job); }
};

class MatvecF16Test : public KernelTest {};
DCLOTH_TEST_EVERY_TABLE(MatvecF16Test);

TEST_P(MatvecF16Test, EverySizeStaysWithinTheBound) { CheckMatvecSizes<F16>(table()); }
TEST_P(MatvecF16Test, RowSubsets) { CheckMatvecRowSubsets<F16>(table()); }

}  // namespace
}  // namespace dcloth::kernels
