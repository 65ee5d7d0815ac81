#include "tools/timing.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "tools/machine.h"

namespace dcloth::tools {

uint64_t NowNanoseconds() {
  using std::chrono::nanoseconds;
  return static_cast<uint64_t>(
      std::chrono::duration_cast<nanoseconds>(std::chrono::steady_clock::now().time_since_epoch()).count());
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

// Filled with something: untouched zero pages would all be one physical page, which fits any cache.
CacheEvictor::CacheEvictor() : memory_((2 * LastLevelCacheBytes() + (uint64_t{4} << 20)) / sizeof(uint64_t), 1) {}

void CacheEvictor::Evict() {
  constexpr size_t kLine = 64 / sizeof(uint64_t);
  uint64_t sum = 0;
  for (size_t i = 0; i < memory_.size(); i += kLine) sum += memory_[i];
  sink_ = sum;
}

}  // namespace dcloth::tools
