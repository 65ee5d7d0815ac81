// Products with int8 weights, with an input of 16 and of twice 16 bits.
#include "engine/src/network/linear.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "engine/src/base/arithmetic.h"
#include "kernels/matvec/matvec_pack.h"

namespace dcloth::engine {
namespace {

constexpr size_t kColumns = 72, kPadded = kernels::PaddedColumns(kColumns);
constexpr double kUnit = 0x1p-24;

// A layer of int8 weights that owns its memory, an input, and what multiplies them in floats of 64 bits.
class Int8Layer {
 public:
  Int8Layer(size_t rows, bool relu) : rows_(rows), padded_rows_(kernels::PairedRows(rows)) {
    std::mt19937 random(static_cast<uint32_t>(rows));
    const auto floats = [&random](size_t count, float low, float high) {
      std::vector<float> values(count);
      for (float& value : values) value = std::uniform_real_distribution<float>(low, high)(random);
      return values;
    };
    source_.resize(rows * kColumns);
    for (int8_t& w : source_) w = static_cast<int8_t>(std::uniform_int_distribution<int>(-127, 127)(random));
    // Panels start on whole lines.
    weights_.resize(kernels::PairPanelElements(rows, kColumns) + 64);
    int8_t* const packed = Aligned(weights_.data());
    kernels::PackPairPanelsI8(source_.data(), {rows, kColumns, kColumns, 1}, packed);
    row_scales_ = floats(rows, 0.5f, 1.5f);
    column_scales_.resize(kPadded + 16);
    float* const scales = Aligned(column_scales_.data());
    std::memcpy(scales, floats(kPadded, 1e-3f, 2e-3f).data(), kPadded * sizeof(float));
    bias_ = floats(kPadded, -1.0f, 1.0f);
    x_ = floats(rows, -1.0f, 1.0f);
    view_ = {packed,
             row_scales_.data(),
             scales,
             bias_.data(),
             static_cast<uint32_t>(rows),
             static_cast<uint32_t>(kColumns),
             format::WeightType::kI8};
    quantized_.resize(padded_rows_);
    rest_x_.resize(rows);
    rest_quantized_.resize(padded_rows_);
    activation_ = relu ? Activation::kRelu : Activation::kNone;
  }

  std::vector<float>& x() { return x_; }

  // In calls of `portion` panels.
  std::vector<float> Multiply(bool with_rest, size_t portion) {
    std::vector<float> y(kPadded, std::numeric_limits<float>::quiet_NaN());
    LinearProduct product = {&view_, x_.data(), rows_, activation_, quantized_.data(), y.data()};
    if (with_rest) product.rest = {rest_x_.data(), rest_quantized_.data()};
    scales_ = QuantizeInput(ActiveKernels(), product);
    const size_t panels = kernels::PanelCount(kColumns);
    for (size_t begin = 0; begin < panels; begin += portion) {
      ApplyPanels(ActiveKernels(), product, scales_, begin, std::min(portion, panels - begin));
    }
    return y;
  }

  // The largest distance from the exact result, in units of what roundings of floats and of integers of `step` allow.
  double WorstError(const std::vector<float>& y, double step) const {
    double worst = 0;
    for (size_t c = 0; c < kColumns; ++c) {
      double sum = 0, size = 0, weights = 0;
      for (size_t j = 0; j < rows_; ++j) {
        const double weight = source_[j * kColumns + c], x = double{x_[j]} * row_scales_[j];
        sum += x * weight;
        size += std::fabs(x * weight);
        weights += std::fabs(weight);
      }
      const double scale = view_.column_scales[c], exact = sum * scale + bias_[c];
      const double wanted = activation_ == Activation::kRelu ? std::max(exact, 0.0) : exact;
      const double allowed = 8 * kUnit * (size * scale + std::fabs(bias_[c])) + 0.51 * step * weights * scale;
      worst = std::max(worst, std::fabs(y[c] - wanted) / allowed);
    }
    return worst;
  }

  const InputScales& scales() const { return scales_; }

 private:
  template <typename T>
  static T* Aligned(T* memory) {
    return reinterpret_cast<T*>((reinterpret_cast<uintptr_t>(memory) + 63) / 64 * 64);
  }

  size_t rows_, padded_rows_;
  std::vector<int8_t> source_, weights_;
  std::vector<float> row_scales_, column_scales_, bias_, x_, rest_x_;
  std::vector<int16_t> quantized_, rest_quantized_;
  format::LinearView view_ = {};
  Activation activation_ = Activation::kNone;
  InputScales scales_;
};

TEST(LinearTest, TheRestMakesIntegersAsExactAsFloats) {
  for (const size_t rows : {1, 2, 57, 512, 1031}) {
    SCOPED_TRACE(rows);
    for (const bool relu : {false, true}) {
      Int8Layer layer(rows, relu);
      const std::vector<float> with = layer.Multiply(true, 1);
      EXPECT_LE(layer.WorstError(with, layer.scales().rest), 1);
      EXPECT_LT(layer.scales().rest, layer.scales().x * 0x1p-13f);
      const std::vector<float> without = layer.Multiply(false, 1);
      EXPECT_LE(layer.WorstError(without, layer.scales().x), 1);
      EXPECT_GT(layer.WorstError(without, 0), 4) << "16 bits are as good";
    }
  }
}

TEST(LinearTest, PortionsGiveTheSameBits) {
  Int8Layer layer(57, false);
  for (const bool with_rest : {false, true}) {
    const std::vector<float> whole = layer.Multiply(with_rest, kPadded);
    for (const size_t portion : {1, 2}) {
      const std::vector<float> parts = layer.Multiply(with_rest, portion);
      EXPECT_EQ(std::memcmp(whole.data(), parts.data(), kPadded * sizeof(float)), 0) << portion;
    }
  }
}

// A scaled input that is not finite counts as zero, in the rest as well.
TEST(LinearTest, InputsThatAreNotFiniteCountAsZero) {
  Int8Layer layer(57, false), zero(57, false);
  layer.x()[3] = std::numeric_limits<float>::infinity();
  layer.x()[20] = std::numeric_limits<float>::quiet_NaN();
  zero.x()[3] = zero.x()[20] = 0.0f;
  const std::vector<float> y = layer.Multiply(true, 1), expected = zero.Multiply(true, 1);
  EXPECT_EQ(std::memcmp(y.data(), expected.data(), kPadded * sizeof(float)), 0);
}

}  // namespace
}  // namespace dcloth::engine
