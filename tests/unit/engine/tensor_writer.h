// Appends tensors to a model's weight vector and remembers what they hold, in double.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_TENSOR_WRITER_H_
#define DCLOTH_TESTS_UNIT_ENGINE_TENSOR_WRITER_H_

#include <cstdint>
#include <memory>
#include <random>
#include <set>
#include <vector>

#include "tests/unit/engine/model_builder.h"

namespace dcloth::testing {

using TensorTable = std::unique_ptr<format::TensorT>;

// What is not random about a layer.
struct LinearKind {
  std::set<size_t> zero_rows = {}, zero_columns = {};
  bool row_scales = true;  // of int8 weights
};

class TensorWriter {
 public:
  TensorWriter(format::DType precision, uint32_t seed, std::vector<uint8_t>* weights)
      : precision_(precision), random_(seed), weights_(weights) {}

  double Uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }

  template <typename T>
  TensorTable Add(format::DType dtype, std::vector<uint32_t> shape, const std::vector<T>& values) {
    return AddBytes(dtype, std::move(shape), values.data(), values.size() * sizeof(T));
  }

  TensorTable Floats(std::vector<uint32_t> shape, const std::vector<float>& values, std::vector<double>* kept);
  TensorTable RandomFloats(std::vector<uint32_t> shape, double low, double high, std::vector<double>* kept);
  TensorTable RandomBytes(std::vector<uint32_t> shape, uint32_t limit, std::vector<uint8_t>* kept);

  // Weights whose magnitudes sum to about `gain` over a column; a bias unless its size is 0.
  std::unique_ptr<format::LinearT> RandomLinear(uint32_t rows, uint32_t columns, double gain, double bias, Linear* kept,
                                                const LinearKind& kind = {});

 private:
  TensorTable AddBytes(format::DType dtype, std::vector<uint32_t> shape, const void* values, size_t size);
  void AddInt8(const std::vector<float>& weights, bool with_row_scales, format::LinearT* table, Linear* kept);

  format::DType precision_;
  std::mt19937 random_;
  std::vector<uint8_t>* weights_;
};

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_TENSOR_WRITER_H_
