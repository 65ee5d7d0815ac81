#include "bench/kernels/fma_loop.h"

#include <algorithm>
#include <chrono>
#include <cstddef>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace dcloth::kernels {

#if defined(__x86_64__)
namespace {

volatile float sink;

// Twelve chains: four cycles of latency at up to three multiply-adds a cycle.
constexpr size_t kChains = 12;
constexpr size_t kSteps = 100'000;

__attribute__((target("avx2,fma"))) double Run256() {
  __m256 sums[kChains];
  for (__m256& sum : sums) sum = _mm256_set1_ps(1.0f);
  const __m256 a = _mm256_set1_ps(0.5f), b = _mm256_set1_ps(0.25f);
  for (size_t step = 0; step < kSteps; ++step) {
#pragma GCC unroll 12
    for (__m256& sum : sums) sum = _mm256_fmadd_ps(sum, a, b);
  }
  __m256 total = _mm256_setzero_ps();
  for (const __m256& sum : sums) total = _mm256_add_ps(total, sum);
  sink = _mm256_cvtss_f32(total);
  return 8.0 * kChains * kSteps;
}

__attribute__((target("avx512f"))) double Run512() {
  __m512 sums[kChains];
  for (__m512& sum : sums) sum = _mm512_set1_ps(1.0f);
  const __m512 a = _mm512_set1_ps(0.5f), b = _mm512_set1_ps(0.25f);
  for (size_t step = 0; step < kSteps; ++step) {
#pragma GCC unroll 12
    for (__m512& sum : sums) sum = _mm512_fmadd_ps(sum, a, b);
  }
  __m512 total = _mm512_setzero_ps();
  for (const __m512& sum : sums) total = _mm512_add_ps(total, sum);
  sink = _mm512_cvtss_f32(total);
  return 16.0 * kChains * kSteps;
}

}  // namespace

double RunMultiplyAdds(uint32_t bits) {
  if (bits == 256 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return Run256();
  if (bits == 512 && __builtin_cpu_supports("avx512f")) return Run512();
  return 0;
}
#else
double RunMultiplyAdds(uint32_t) { return 0; }
#endif

double MultiplyAddRate(uint32_t bits) {
  using Clock = std::chrono::steady_clock;
  double best = 0;
  for (int pass = 0; pass < 200; ++pass) {
    const auto start = Clock::now();
    const double count = RunMultiplyAdds(bits);
    if (count == 0) return 0;
    best = std::max(best, count / std::chrono::duration<double, std::nano>(Clock::now() - start).count());
  }
  return best;
}

}  // namespace dcloth::kernels
