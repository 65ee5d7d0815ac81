#include "tools/machine_limit.h"

#include <algorithm>
#include <cstddef>
#include <vector>

#include "tools/machine.h"
#include "tools/timing.h"

#if defined(__x86_64__) && defined(__GNUC__)
#include <immintrin.h>
#define DCLOTH_HAS_AVX2_LIMIT 1
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

namespace dcloth::tools {
namespace {

volatile float float_sink;
volatile uint64_t integer_sink;

// Enough independent sums for two units of four or five cycles' latency, few enough for sixteen registers.
constexpr int kSums = 12;

struct Unit {
  const char* name;
  int lanes;
  void (*multiply_add)(size_t rounds);  // kSums x lanes multiply-adds a round
};

#if defined(DCLOTH_HAS_AVX2_LIMIT)
__attribute__((target("avx2,fma"))) void MultiplyAddAvx2(size_t rounds) {
  __m256 sums[kSums];
  for (__m256& sum : sums) sum = _mm256_set1_ps(1.0f);
  const __m256 factor = _mm256_set1_ps(0.999f), term = _mm256_set1_ps(0.001f);
  for (size_t i = 0; i < rounds; ++i) {
    for (int s = 0; s < kSums; ++s) sums[s] = _mm256_fmadd_ps(sums[s], factor, term);
  }
  __m256 total = sums[0];
  for (int s = 1; s < kSums; ++s) total = _mm256_add_ps(total, sums[s]);
  float_sink = _mm256_cvtss_f32(total);
}
#endif

#if defined(__aarch64__)
void MultiplyAddPlain(size_t rounds) {
  float32x4_t sums[kSums];
  for (float32x4_t& sum : sums) sum = vdupq_n_f32(1.0f);
  const float32x4_t factor = vdupq_n_f32(0.999f), term = vdupq_n_f32(0.001f);
  for (size_t i = 0; i < rounds; ++i) {
    for (int s = 0; s < kSums; ++s) sums[s] = vfmaq_f32(term, sums[s], factor);
  }
  float32x4_t total = sums[0];
  for (int s = 1; s < kSums; ++s) total = vaddq_f32(total, sums[s]);
  float_sink = vgetq_lane_f32(total, 0);
}
constexpr Unit kPlainUnit = {"NEON FMA", 4, MultiplyAddPlain};
#else
void MultiplyAddPlain(size_t rounds) {
  float sums[kSums][4];
  for (auto& sum : sums) std::fill(std::begin(sum), std::end(sum), 1.0f);
  for (size_t i = 0; i < rounds; ++i) {
    for (auto& sum : sums) {
      for (float& lane : sum) lane = lane * 0.999f + 0.001f;
    }
  }
  float total = 0;
  for (const auto& sum : sums) total += sum[0] + sum[1] + sum[2] + sum[3];
  float_sink = total;
}
constexpr Unit kPlainUnit = {"128-bit multiply and add", 4, MultiplyAddPlain};
#endif

Unit BestUnit() {
#if defined(DCLOTH_HAS_AVX2_LIMIT)
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) return {"AVX2 FMA", 8, MultiplyAddAvx2};
#endif
  return kPlainUnit;
}

double SecondsOf(const auto& work) {
  const uint64_t start = NowNanoseconds();
  work();
  return static_cast<double>(std::max<uint64_t>(NowNanoseconds() - start, 1)) * 1e-9;
}

constexpr size_t kPiece = 65536;        // words, 512 KiB: some ten microseconds, seldom interrupted
constexpr size_t kPrefetchWords = 256;  // 2 KiB ahead, as the kernels do

// `count` words, a multiple of 32. What is waited for is the loads.
void ReadPlain(const uint64_t* words, size_t count) {
  uint64_t sums[8] = {};
  for (size_t i = 0; i < count; i += 8) {
#if defined(__GNUC__)
    __builtin_prefetch(words + i + kPrefetchWords);
#endif
    for (size_t s = 0; s < 8; ++s) sums[s] += words[i + s];
  }
  uint64_t total = 0;
  for (const uint64_t sum : sums) total += sum;
  integer_sink = total;
}

#if defined(DCLOTH_HAS_AVX2_LIMIT)
__attribute__((target("avx2"))) void ReadAvx2(const uint64_t* words, size_t count) {
  __m256i sums[8];
  for (__m256i& sum : sums) sum = _mm256_setzero_si256();
  for (size_t i = 0; i < count; i += 32) {
    for (size_t s = 0; s < 8; ++s) {
      const uint64_t* at = words + i + 4 * s;
      if (s % 2 == 0) __builtin_prefetch(at + kPrefetchWords);
      sums[s] = _mm256_add_epi64(sums[s], _mm256_loadu_si256(reinterpret_cast<const __m256i*>(at)));
    }
  }
  for (int s = 1; s < 8; ++s) sums[0] = _mm256_add_epi64(sums[0], sums[s]);
  integer_sink = static_cast<uint64_t>(_mm256_extract_epi64(sums[0], 0));
}
#endif

void Read(const uint64_t* words, size_t count) {
#if defined(DCLOTH_HAS_AVX2_LIMIT)
  if (__builtin_cpu_supports("avx2")) return ReadAvx2(words, count);
#endif
  ReadPlain(words, count);
}

// Reads `bytes` over and over in pieces, `total_bytes` in all. The rate that one piece in ten exceeds: the best of all
// may be luck, and most others share the machine. Filled with something: untouched pages are all one page.
double ReadGbs(uint64_t bytes, uint64_t total_bytes) {
  const size_t count = std::max<size_t>(bytes / sizeof(uint64_t) / 32 * 32, 512);
  const std::vector<uint64_t> memory(count + kPrefetchWords + 32, 1);
  Read(memory.data(), count);
  std::vector<double> rates;
  for (uint64_t done = 0; done < total_bytes; done += count * sizeof(uint64_t)) {
    for (size_t at = 0; at < count; at += kPiece) {
      const size_t words = std::min(kPiece, count - at);
      if (words < kPiece && at > 0) break;
      const double seconds = SecondsOf([&] { Read(memory.data() + at, words); });
      rates.push_back(static_cast<double>(words * sizeof(uint64_t)) / seconds * 1e-9);
    }
  }
  std::sort(rates.begin(), rates.end());
  return rates[rates.size() * 9 / 10];
}

}  // namespace

MachineLimit MeasureLimit(uint64_t working_set_bytes) {
  constexpr size_t kRounds = 100000;  // some hundred microseconds
  constexpr int kRuns = 60;
  MachineLimit limit;
  const Unit unit = BestUnit();
  limit.unit = unit.name;
  double best = 1e9;
  for (int i = 0; i < kRuns; ++i) best = std::min(best, SecondsOf([&] { unit.multiply_add(kRounds); }));
  limit.gflops = 2.0 * kSums * unit.lanes * kRounds / best * 1e-9;
  limit.read_bytes = working_set_bytes;
  limit.read_gbs = ReadGbs(working_set_bytes, uint64_t{1} << 29);
  const uint64_t beyond = 2 * LastLevelCacheBytes() + (uint64_t{4} << 20);
  limit.memory_gbs = ReadGbs(beyond, 4 * beyond);
  return limit;
}

}  // namespace dcloth::tools
