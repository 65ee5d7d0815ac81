#include "tests/unit/kernels/matvec_float_test.h"

namespace dcloth::kernels {
namespace {

struct F32 {
  using Job = MatvecF32Job;
  using Weight = float;
  static void Pack(const float* source, const MatrixShape& shape, float* packed) {
    PackPanelsF32(source, shape, packed);
  }
  static double Decode(float value) { return value; }
  static void Run(const KernelTable& table, const MatvecF32Job& job) { table.matvec_f32(job); }
};

class MatvecF32Test : public KernelTest {};
DCLOTH_TEST_EVERY_TABLE(MatvecF32Test);

TEST_P(MatvecF32Test, EverySizeStaysWithinTheBound) { CheckMatvecSizes<F32>(table()); }
TEST_P(MatvecF32Test, RowSubsets) { CheckMatvecRowSubsets<F32>(table()); }

TEST(MatvecPackF32, PutsElementsWhereTheSchemaSays) {
  constexpr size_t kRows = 5, kColumns = 70;
  std::vector<float> source(kRows * kColumns);
  for (size_t i = 0; i < source.size(); ++i) source[i] = static_cast<float>(i + 1);
  std::vector<float> packed(PanelElements(kRows, kColumns), -1.0f), transposed(packed);
  ASSERT_EQ(packed.size(), 3 * kRows * kPanelColumns);
  PackPanelsF32(source.data(), {kRows, kColumns, kColumns, 1}, packed.data());
  for (size_t j = 0; j < kRows; ++j) {
    for (size_t c = 0; c < 96; ++c) {
      const float expected = c < kColumns ? source[j * kColumns + c] : 0.0f;
      ASSERT_EQ(packed[(c / 32 * kRows + j) * 32 + c % 32], expected) << j << " " << c;
    }
  }
  // The same matrix stored [out, in].
  std::vector<float> out_in(source.size());
  for (size_t j = 0; j < kRows; ++j) {
    for (size_t c = 0; c < kColumns; ++c) out_in[c * kRows + j] = source[j * kColumns + c];
  }
  PackPanelsF32(out_in.data(), {kRows, kColumns, 1, kRows}, transposed.data());
  EXPECT_EQ(packed, transposed);
}

}  // namespace
}  // namespace dcloth::kernels
