// What the kernel tests share: every instruction set of the machine as a test parameter, random data, error bounds.
#ifndef DCLOTH_TESTS_UNIT_KERNELS_KERNEL_TEST_H_
#define DCLOTH_TESTS_UNIT_KERNELS_KERNEL_TEST_H_

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "kernels/kernels.h"
#include "tests/unit/kernels/guarded_buffer.h"

namespace dcloth::kernels {

inline std::vector<const KernelTable*> AllTables() {
  std::vector<const KernelTable*> tables;
  for (size_t i = 0; i < KernelTableCount(); ++i) tables.push_back(KernelTableAt(i));
  return tables;
}

class KernelTest : public testing::TestWithParam<const KernelTable*> {
 protected:
  const KernelTable& table() const { return *GetParam(); }
};

inline std::string TableName(const testing::TestParamInfo<const KernelTable*>& info) { return info.param->name; }

#define DCLOTH_TEST_EVERY_TABLE(Suite) \
  INSTANTIATE_TEST_SUITE_P(EveryIsa, Suite, testing::ValuesIn(AllTables()), TableName)

// Every size to 70, then primes around larger powers of two.
inline std::vector<size_t> InterestingSizes() {
  std::vector<size_t> sizes;
  for (size_t i = 1; i <= 70; ++i) sizes.push_back(i);
  for (size_t prime : {97, 127, 131, 251, 257, 509, 521, 1021, 1031}) sizes.push_back(prime);
  return sizes;
}

class Random {
 public:
  explicit Random(uint32_t seed) : engine_(seed) {}
  float Uniform(float low, float high) { return std::uniform_real_distribution<float>(low, high)(engine_); }
  uint32_t Below(uint32_t limit) { return std::uniform_int_distribution<uint32_t>(0, limit - 1)(engine_); }
  std::vector<float> Floats(size_t count, float low, float high) {
    std::vector<float> values(count);
    for (float& value : values) value = Uniform(low, high);
    return values;
  }

 private:
  std::mt19937 engine_;
};

constexpr double kUnit = 0x1p-24;  // unit roundoff of float

// gamma_k = k u / (1 - k u): k roundings in a row change a value by at most this fraction. Higham, Accuracy and
// Stability of Numerical Algorithms, 2nd ed., lemma 3.1; a sum of n products in any order has k = n (+ 1 with a bias).
inline double Gamma(double k) { return k * kUnit / (1 - k * kUnit); }

inline double ExactSigmoid(double x) { return 1.0 / (1.0 + std::exp(-x)); }

}  // namespace dcloth::kernels

#endif  // DCLOTH_TESTS_UNIT_KERNELS_KERNEL_TEST_H_
