// The f32 and f16 products against plain loops in double.
#include <cstring>

#include "kernels/half.h"
#include "kernels/matvec/matvec_pack.h"
#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {
namespace {

struct MatvecCase {
  size_t rows;
  size_t columns;
  size_t row_count;
  bool bias;
  bool relu;
};

// Format: Weight, Job, Pack(source, shape, packed), Decode(weight) and Run(table, job).
template <typename Format>
void CheckMatvec(const KernelTable& table, const MatvecCase& c) {
  SCOPED_TRACE(testing::Message() << table.name << " rows " << c.rows << " columns " << c.columns << " count "
                                  << c.row_count << " relu " << c.relu);
  Random random(static_cast<uint32_t>(c.rows * 131 + c.columns));
  const std::vector<float> source = random.Floats(c.rows * c.columns, -1.0f, 1.0f);
  GuardedBuffer<typename Format::Weight> weights(PanelElements(c.rows, c.columns), Place::kAligned64);
  Format::Pack(source.data(), {c.rows, c.columns, c.columns, 1}, weights.data());
  const GuardedBuffer<float> x(random.Floats(c.row_count, -1.0f, 1.0f));
  const size_t padded = PaddedColumns(c.columns);
  const GuardedBuffer<float> bias(random.Floats(padded, -1.0f, 1.0f));
  // One float of slack in front of the guard page misaligns y.
  GuardedBuffer<float> y(padded + 1);

  const float* bias_data = c.bias ? bias.data() : nullptr;
  typename Format::Job job = {x.data(),    weights.data(),        bias_data, y.data(), c.rows,
                              c.row_count, PanelCount(c.columns), c.relu};
  Format::Run(table, job);

  ASSERT_TRUE(std::isnan(y[padded]));
  ASSERT_TRUE(weights.SlackUntouched() && y.SlackUntouched());
  for (size_t column = 0; column < padded; ++column) {
    double exact = c.bias ? bias[column] : 0.0;
    double magnitude = std::fabs(exact);
    for (size_t j = 0; column < c.columns && j < c.row_count; ++j) {
      const double product = double{x[j]} * Format::Decode(source[j * c.columns + column]);
      exact += product;
      magnitude += std::fabs(product);
    }
    // Rectifying cannot enlarge an error. Below float's range products lose at most half its smallest step each.
    if (c.relu) exact = std::max(exact, 0.0);
    const double bound =
        Gamma(static_cast<double>(c.row_count) + 1) * magnitude + 0x1p-150 * static_cast<double>(c.row_count);
    ASSERT_LE(std::fabs(y[column] - exact), bound) << "column " << column;
  }
  job.in_order = true;
  Format::Run(table, job);
  GuardedBuffer<float> reference(padded + 1);
  job.y = reference.data();
  Format::Run(*FindKernels("scalar"), job);
  ASSERT_EQ(std::memcmp(y.data(), reference.data(), padded * sizeof(float)), 0) << "in order";
  ASSERT_TRUE(std::isnan(y[padded]));
}

template <typename Format>
void CheckMatvecSizes(const KernelTable& table) {
  for (size_t size : InterestingSizes()) {
    CheckMatvec<Format>(table, {size, 33, size, true, false});
    CheckMatvec<Format>(table, {37, size, 37, false, true});
  }
  CheckMatvec<Format>(table, {128, 3 * 521, 128, true, true});
}

template <typename Format>
void CheckMatvecRowSubsets(const KernelTable& table) {
  for (size_t count : {0, 1, 2, 3, 8, 15, 30}) CheckMatvec<Format>(table, {31, 65, count, count % 2 == 0, false});
}

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
