#include "converter/pack.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "converter/file.h"
#include "kernels/half.h"
#include "kernels/kernels.h"
#include "kernels/matvec/matvec_pack.h"
#include "tests/unit/converter/converter_testing.h"

namespace dcloth::converter {
namespace {

template <typename T>
std::vector<T> As(const PackedTensor& tensor) {
  std::vector<T> values(tensor.bytes.size() / sizeof(T));
  std::memcpy(values.data(), tensor.bytes.data(), tensor.bytes.size());
  return values;
}

// Vectors the kernels may take: 64-byte aligned.
template <typename T>
using AlignedVector = std::vector<T, ModelAllocator<T>>;
template <typename T>
AlignedVector<T> Aligned(const PackedTensor& tensor) {
  const std::vector<T> values = As<T>(tensor);
  return {values.begin(), values.end()};
}

struct Problem {
  Matrix weights;
  Vector bias, x;
};

Problem Make(Eigen::Index rows, Eigen::Index columns) {
  std::srand(static_cast<unsigned>(rows * 1000 + columns));
  return {Matrix::Random(rows, columns), Vector::Random(columns), Vector::Random(rows)};
}

// sum_j |x_j| |w_jc| + |b_c|: what a rounding is relative to.
double Magnitude(const Problem& p, Eigen::Index c) {
  double sum = std::abs(static_cast<double>(p.bias[c]));
  for (Eigen::Index j = 0; j < p.x.size(); ++j)
    sum += std::abs(static_cast<double>(p.x[j]) * static_cast<double>(p.weights(j, c)));
  return sum;
}

double Exact(const Problem& p, Eigen::Index c) {
  double sum = static_cast<double>(p.bias[c]);
  for (Eigen::Index j = 0; j < p.x.size(); ++j)
    sum += static_cast<double>(p.x[j]) * static_cast<double>(p.weights(j, c));
  return sum;
}

constexpr std::pair<int, int> kSizes[] = {{1, 1}, {2, 32}, {3, 33}, {7, 31}, {16, 64}, {31, 65}, {64, 97}};

TEST(PackTest, FloatPanelsThroughTheScalarKernel) {
  for (const auto& [rows, columns] : kSizes) {
    const Problem p = Make(rows, columns);
    const PackedLinear linear = PackLinear("l", p.weights, p.bias, Precision::kFp32);
    const auto weights = Aligned<float>(linear.weights);
    const auto bias = Aligned<float>(*linear.bias);
    ASSERT_EQ(weights.size(), kernels::PanelElements(p.weights.rows(), p.weights.cols()));
    AlignedVector<float> y(bias.size(), NAN);
    kernels::scalar::MatvecF32({p.x.data(), weights.data(), bias.data(), y.data(), static_cast<size_t>(rows),
                                static_cast<size_t>(rows), kernels::PanelCount(static_cast<size_t>(columns)), false});
    for (Eigen::Index c = 0; c < columns; ++c) {
      // rows products and rows sums, each rounded once (Higham, Accuracy and Stability, 3.1).
      ASSERT_LE(std::abs(static_cast<double>(y[static_cast<size_t>(c)]) - Exact(p, c)),
                (rows + 2) * 0x1p-24 * Magnitude(p, c));
    }
    for (size_t c = static_cast<size_t>(columns); c < y.size(); ++c) ASSERT_EQ(y[c], 0);  // padding is zero
    EXPECT_EQ(linear.weights.report.loss.relative_rms, 0);
    EXPECT_FALSE(linear.row_scales || linear.column_scales);
  }
}

TEST(PackTest, HalfPanelsThroughTheScalarKernel) {
  for (const auto& [rows, columns] : kSizes) {
    const Problem p = Make(rows, columns);
    const PackedLinear linear = PackLinear("l", p.weights, p.bias, Precision::kFp16);
    const auto weights = Aligned<uint16_t>(linear.weights);
    const auto bias = Aligned<float>(*linear.bias);
    AlignedVector<float> y(bias.size(), NAN);
    kernels::scalar::MatvecF16({p.x.data(), weights.data(), bias.data(), y.data(), static_cast<size_t>(rows),
                                static_cast<size_t>(rows), kernels::PanelCount(static_cast<size_t>(columns)), false});
    for (Eigen::Index c = 0; c < columns; ++c) {
      const double stored = 0x1p-11 * Magnitude(p, c) + 0x1p-25 * static_cast<double>(p.x.cwiseAbs().sum());
      ASSERT_LE(std::abs(static_cast<double>(y[static_cast<size_t>(c)]) - Exact(p, c)),
                stored + (rows + 2) * 0x1p-24 * (Magnitude(p, c) + stored));
    }
    // rms of uniform rounding within 2^-12 .. 2^-11 of each value; zero would mean nothing was measured.
    EXPECT_LE(linear.weights.report.loss.relative_max, 0x1p-11);
    if (rows * columns > 10) {
      EXPECT_GT(linear.weights.report.loss.relative_rms, 0x1p-15);
    }
  }
}

TEST(PackTest, Int8PairPanelsThroughTheScalarKernels) {
  for (const auto& [rows, columns] : kSizes) {
    const Problem p = Make(rows, columns);
    const PackedLinear linear = PackLinear("l", p.weights, p.bias, Precision::kInt8);
    const auto weights = Aligned<int8_t>(linear.weights);
    const auto row_scales = Aligned<float>(*linear.row_scales);
    const auto column_scales = Aligned<float>(*linear.column_scales);
    const auto bias = Aligned<float>(*linear.bias);
    const size_t stored_rows = kernels::PairedRows(static_cast<size_t>(rows));
    ASSERT_EQ(row_scales.size(), static_cast<size_t>(rows));
    ASSERT_EQ(column_scales.size(), kernels::PaddedColumns(static_cast<size_t>(columns)));
    for (const float scale : column_scales) ASSERT_GT(scale, 0);  // the padding's too
    AlignedVector<int16_t> q(stored_rows);
    AlignedVector<float> y(bias.size(), NAN);
    float x_scale = 0;
    kernels::scalar::QuantizeI16({p.x.data(), row_scales.data(), q.data(), &x_scale, static_cast<size_t>(rows)});
    kernels::scalar::MatvecI8({q.data(), weights.data(), column_scales.data(), bias.data(), y.data(), x_scale,
                               stored_rows, stored_rows, kernels::PanelCount(static_cast<size_t>(columns)), false});
    for (Eigen::Index c = 0; c < columns; ++c) {
      // Weights err by half a step s_j t_c, inputs by half of x_scale (in units of s_j x_j) times 127 t_c at most.
      double bound = 0;
      const double t = static_cast<double>(column_scales[static_cast<size_t>(c)]);
      for (Eigen::Index j = 0; j < rows; ++j) {
        const double s = static_cast<double>(row_scales[static_cast<size_t>(j)]);
        bound += std::abs(static_cast<double>(p.x[j])) * s * t * 0.501 + 0.501 * static_cast<double>(x_scale) * 127 * t;
      }
      bound += 8 * 0x1p-24 * (Magnitude(p, c) + bound);  // the few float roundings at the end
      ASSERT_LE(std::abs(static_cast<double>(y[static_cast<size_t>(c)]) - Exact(p, c)), bound)
          << rows << " x " << columns;
    }
    // Half a step of the largest weight is 1 / 254 of it.
    EXPECT_LE(linear.weights.report.loss.relative_max, 1.001 / 254);
  }
}

TEST(PackTest, ShapesAndSizesAreReported) {
  const PackedLinear linear = PackLinear("stage.hidden", Matrix::Random(3, 33), Vector(), Precision::kInt8);
  EXPECT_EQ(linear.weights.report.name, "stage.hidden.weights");
  EXPECT_EQ(linear.weights.report.dtype, "i8");
  EXPECT_EQ(linear.weights.report.shape, (std::vector<uint32_t>{3, 33}));
  EXPECT_EQ(linear.weights.report.size_bytes, 4u * 64);
  EXPECT_FALSE(linear.bias);
  const PackedTensor indices = PackIndices("i", StoredType::kU16, {2, 2}, {1, 2, 3, 65535});
  EXPECT_EQ(As<uint16_t>(indices), (std::vector<uint16_t>{1, 2, 3, 65535}));
  EXPECT_EQ(As<uint8_t>(PackIndices("i", StoredType::kU8, {2}, {0, 255})), (std::vector<uint8_t>{0, 255}));
  EXPECT_EQ(As<uint32_t>(PackIndices("i", StoredType::kU32, {1}, {UINT32_MAX})), (std::vector<uint32_t>{UINT32_MAX}));
}

}  // namespace
}  // namespace dcloth::converter
