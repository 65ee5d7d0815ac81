#include "tools/timing.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <ctime>

#include "tools/machine.h"

#if defined(__x86_64__) || defined(_M_X64) || defined(__SSE2__)
#include <emmintrin.h>
#define DCLOTH_FLUSHES_LINES
#elif defined(__aarch64__) && defined(__linux__)
#define DCLOTH_FLUSHES_LINES
#endif

namespace dcloth::tools {
namespace {

#if defined(__x86_64__) || defined(_M_X64) || defined(__SSE2__)
void FlushLine(const std::byte* at) { _mm_clflush(at); }
#elif defined(__aarch64__) && defined(__linux__)
void FlushLine(const std::byte* at) { asm volatile("dc civac, %0" : : "r"(at) : "memory"); }
#endif

}  // namespace

uint64_t NowNanoseconds() {
  using std::chrono::nanoseconds;
  return static_cast<uint64_t>(
      std::chrono::duration_cast<nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()).count());
}

uint64_t ThreadNanoseconds() {
#if defined(_WIN32)
  return NowNanoseconds();
#else
  timespec spent{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &spent);
  return static_cast<uint64_t>(spent.tv_sec) * 1'000'000'000 + static_cast<uint64_t>(spent.tv_nsec);
#endif
}

bool IsInterrupted(uint64_t wall, uint64_t work) {
  constexpr uint64_t kLeast = 20'000;
  return wall > work + kLeast && (wall - work) * 20 > wall;
}

Percentiles PercentilesOf(std::span<const double> samples) {
  if (samples.empty()) return {};
  std::vector<double> sorted(samples.begin(), samples.end());
  std::sort(sorted.begin(), sorted.end());
  const auto rank = [&](double q) {
    const auto position = static_cast<size_t>(std::ceil(q * static_cast<double>(sorted.size())));
    return sorted[std::clamp<size_t>(position, 1, sorted.size()) - 1];
  };
  return {rank(0.50), rank(0.95), rank(0.99), sorted.back()};
}

StepTimer::StepTimer() {
  timer_.struct_size = sizeof(timer_);
  timer_.now = [](void*) { return NowNanoseconds(); };
}

StepTimes StepTimer::Take() {
  StepTimes times;
  std::copy(std::begin(timer_.elapsed), std::end(timer_.elapsed), times.begin());
  std::fill(std::begin(timer_.elapsed), std::end(timer_.elapsed), 0);
  return times;
}

void CacheEvictor::Evict(std::initializer_list<std::span<const std::byte>> memories) {
#if defined(DCLOTH_FLUSHES_LINES)
  constexpr size_t kLine = 64;
  for (const std::span<const std::byte> memory : memories) {
    for (size_t i = 0; i < memory.size(); i += kLine) FlushLine(memory.data() + i);
    if (!memory.empty()) FlushLine(&memory.back());
  }
  Read(uint64_t{8} << 20, &near_);
#else
  static_cast<void>(memories);
  EvictAll();
#endif
}

uint64_t CacheEvictor::AllBytes() { return 2 * LastLevelCacheBytes() + (uint64_t{4} << 20); }

void CacheEvictor::EvictAll() { Read(AllBytes(), &all_); }

void CacheEvictor::Read(uint64_t bytes, std::vector<uint64_t>* memory) {
  constexpr size_t kLine = 64 / sizeof(uint64_t);
  // Filled with something: untouched zero pages would all be one physical page, which fits any cache.
  if (memory->empty()) memory->assign(bytes / sizeof(uint64_t), 1);
  uint64_t sum = 0;
  for (size_t i = 0; i < memory->size(); i += kLine) sum += (*memory)[i];
  sink_ = sum;
}

}  // namespace dcloth::tools
