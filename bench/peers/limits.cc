// What one core can do at most: bytes read from memory and float32 multiply-adds a second.
#include <algorithm>
#include <cstddef>
#include <vector>

#include "bench/peers/engine.h"
#include "tools/timing.h"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace {

using dcloth::tools::NowNanoseconds;

// Pieces far shorter than a scheduler's slice, so that a busy machine interrupts few of them.
constexpr int kReadPasses = 5;
constexpr size_t kPiece = (1u << 20) / sizeof(uint64_t);
constexpr int kFmaPasses = 200;

volatile uint64_t sink;

// Sixteen sums, which fit registers: loads are independent and additions never wait.
uint64_t Sum(const uint64_t* data, size_t count) {
  constexpr size_t kLanes = 16;
  uint64_t lanes[kLanes] = {};
  for (size_t i = 0; i + kLanes <= count; i += kLanes) {
    for (size_t lane = 0; lane < kLanes; ++lane) lanes[lane] += data[i + lane];
  }
  uint64_t sum = 0;
  for (uint64_t lane : lanes) sum += lane;
  return sum;
}

#if defined(__x86_64__)
// Twelve chains: four cycles of latency at up to three multiply-adds a cycle.
constexpr size_t kChains = 12;
constexpr size_t kSteps = 100'000;

__attribute__((target("avx2,fma"))) double FmaLanes256() {
  __m256 sums[kChains];
  for (__m256& sum : sums) sum = _mm256_set1_ps(1.0f);
  const __m256 a = _mm256_set1_ps(0.5f), b = _mm256_set1_ps(0.25f);
  for (size_t step = 0; step < kSteps; ++step) {
#pragma GCC unroll 12
    for (__m256& sum : sums) sum = _mm256_fmadd_ps(sum, a, b);
  }
  __m256 total = _mm256_setzero_ps();
  for (const __m256& sum : sums) total = _mm256_add_ps(total, sum);
  sink = static_cast<uint64_t>(_mm256_cvtss_f32(total));
  return 8;
}

__attribute__((target("avx512f"))) double FmaLanes512() {
  __m512 sums[kChains];
  for (__m512& sum : sums) sum = _mm512_set1_ps(1.0f);
  const __m512 a = _mm512_set1_ps(0.5f), b = _mm512_set1_ps(0.25f);
  for (size_t step = 0; step < kSteps; ++step) {
#pragma GCC unroll 12
    for (__m512& sum : sums) sum = _mm512_fmadd_ps(sum, a, b);
  }
  __m512 total = _mm512_setzero_ps();
  for (const __m512& sum : sums) total = _mm512_add_ps(total, sum);
  sink = static_cast<uint64_t>(_mm512_cvtss_f32(total));
  return 16;
}
#endif

}  // namespace

double peers_read_rate(uint64_t bytes) {
  const std::vector<uint64_t> data(bytes / sizeof(uint64_t), 1);
  std::vector<double> rates;
  for (int pass = 0; pass < kReadPasses; ++pass) {
    for (size_t at = 0; at + kPiece <= data.size(); at += kPiece) {
      const uint64_t start = NowNanoseconds();
      sink = Sum(data.data() + at, kPiece);
      const auto spent = static_cast<double>(NowNanoseconds() - start);
      rates.push_back(static_cast<double>(kPiece * sizeof(uint64_t)) / spent);
    }
  }
  return dcloth::tools::PercentilesOf(rates).p50;
}

double peers_fma_rate(uint32_t bits) {
#if defined(__x86_64__)
  double (*run)() = nullptr;
  if (bits == 256 && __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) run = FmaLanes256;
  if (bits == 512 && __builtin_cpu_supports("avx512f")) run = FmaLanes512;
  double best = 0;
  for (int pass = 0; run != nullptr && pass < kFmaPasses; ++pass) {
    const uint64_t start = NowNanoseconds();
    const double lanes = run();
    const auto spent = static_cast<double>(NowNanoseconds() - start);
    best = std::max(best, lanes * static_cast<double>(kChains * kSteps) / spent);
  }
  return best;
#else
  (void)bits;
  return 0;
#endif
}
