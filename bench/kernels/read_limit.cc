#include "bench/kernels/read_limit.h"

namespace dcloth::kernels {
namespace {

constexpr size_t kLines = 8;  // 64-byte lines a step, so that no addition waits for another
constexpr size_t kWords = 8;  // of a line

#if defined(__x86_64__)
#define DCLOTH_WIDE_LOADS __attribute__((target_clones("avx2", "default")))
#else
#define DCLOTH_WIDE_LOADS
#endif

DCLOTH_WIDE_LOADS uint64_t SumLines(const uint64_t* data, const size_t* begins, size_t step, size_t steps) {
  uint64_t sums[kWords] = {};
  for (size_t i = 0; i < steps; ++i) {
    for (size_t k = 0; k < kLines; ++k) {
      const uint64_t* line = data + begins[k] + i * step;
      for (size_t w = 0; w < kWords; ++w) sums[w] += line[w];
    }
  }
  uint64_t sum = 0;
  for (uint64_t s : sums) sum += s;
  return sum;
}

DCLOTH_WIDE_LOADS uint64_t SumLinesAhead(const uint64_t* data, const size_t* begins, size_t step, size_t steps,
                                         size_t ahead) {
  uint64_t sums[kWords] = {};
  for (size_t i = 0; i < steps; ++i) {
    for (size_t k = 0; k < kLines; ++k) {
      const uint64_t* line = data + begins[k] + i * step;
      // May lie past the end, where a prefetch does nothing but a pointer may not be.
      __builtin_prefetch(reinterpret_cast<const void*>(reinterpret_cast<uintptr_t>(line) + ahead));
      for (size_t w = 0; w < kWords; ++w) sums[w] += line[w];
    }
  }
  uint64_t sum = 0;
  for (uint64_t s : sums) sum += s;
  return sum;
}

}  // namespace

uint64_t ReadAll(const uint8_t* data, size_t bytes, ReadOrder order) {
  const auto* words = reinterpret_cast<const uint64_t*>(data);
  const size_t steps = bytes / (kLines * kWords * sizeof(uint64_t)), step = kLines / order.streams * kWords;
  size_t begins[kLines];
  for (size_t k = 0; k < kLines; ++k) {
    begins[k] = k % order.streams * steps * step + k / order.streams * kWords;
  }
  return order.prefetch_bytes == 0 ? SumLines(words, begins, step, steps)
                                   : SumLinesAhead(words, begins, step, steps, order.prefetch_bytes);
}

}  // namespace dcloth::kernels
