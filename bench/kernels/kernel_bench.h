// What the kernel benches share: aligned random data, a cache eviction, one benchmark per instruction set, counters.
//
// "cold" runs empty the caches before every call, because in a game everything else of the frame did. Report medians:
//   bench_skinning --benchmark_repetitions=9 --benchmark_report_aggregates_only
#ifndef DCLOTH_BENCH_KERNELS_KERNEL_BENCH_H_
#define DCLOTH_BENCH_KERNELS_KERNEL_BENCH_H_

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <random>
#include <string>
#include <string_view>
#include <vector>

#include "kernels/kernels.h"

namespace dcloth::kernels {

// Zeros, starting on 64 bytes.
template <typename T>
class AlignedArray {
 public:
  explicit AlignedArray(size_t count) : count_(count), storage_(count + 64 / sizeof(T)) {
    const size_t past = reinterpret_cast<uintptr_t>(storage_.data()) % 64;
    data_ = storage_.data() + (past == 0 ? 0 : (64 - past) / sizeof(T));
  }
  AlignedArray(AlignedArray&&) = default;
  AlignedArray& operator=(AlignedArray&&) = default;
  T* data() { return data_; }
  size_t size() const { return count_; }
  T& operator[](size_t i) { return data_[i]; }

 private:
  size_t count_;
  std::vector<T> storage_;
  T* data_;
};

inline AlignedArray<float> RandomFloats(size_t count, float low, float high, uint32_t seed = 1) {
  std::mt19937 engine(seed);
  std::uniform_real_distribution<float> distribution(low, high);
  AlignedArray<float> values(count);
  for (size_t i = 0; i < count; ++i) values[i] = distribution(engine);
  return values;
}

// Reads more than twice the last-level cache of the machines at hand (32 MB). Writing would leave dirty lines, which
// the timed part would have to write back.
inline void EvictCaches() {
  static AlignedArray<uint8_t> junk = [] {
    AlignedArray<uint8_t> pages(96u << 20);
    std::fill_n(pages.data(), pages.size(), uint8_t{1});
    return pages;
  }();
  uint64_t sum = 0;
  for (size_t i = 0; i < junk.size(); i += 64) sum += junk[i];
  benchmark::DoNotOptimize(sum);
  benchmark::ClobberMemory();
}

// Times `call`; `bytes` are what it must read and write, `flops` what it computes (a multiply-add counts two).
inline void Measure(benchmark::State& state, bool cold, double bytes, double flops, double max_error,
                    const std::function<void()>& call) {
  using Clock = std::chrono::steady_clock;
  double seconds = 0, fastest = 1e9;
  call();
  for (auto _ : state) {
    if (cold) EvictCaches();
    const auto begin = Clock::now();
    call();
    benchmark::ClobberMemory();
    const double elapsed = std::chrono::duration<double>(Clock::now() - begin).count();
    state.SetIterationTime(elapsed);
    seconds += elapsed;
    fastest = std::min(fastest, elapsed);
  }
  const double calls = static_cast<double>(state.iterations());
  state.counters["min_us"] = fastest * 1e6;  // the figure to read on a machine that does other work too
  state.counters["GB/s"] = bytes * calls / seconds * 1e-9;
  if (flops > 0) state.counters["GFLOP/s"] = flops * calls / seconds * 1e-9;
  state.counters["max_error"] = max_error;
}

// The best instruction sets of this CPU, at most two; the slower ones, which no such CPU uses, are left out.
inline std::vector<const KernelTable*> BestTables() {
  std::vector<const KernelTable*> tables;
  for (size_t i = 0; i < KernelTableCount() && tables.size() < 2; ++i) {
    const KernelTable* table = KernelTableAt(i);
    const std::string_view name = table->name;
    if (name != "reproducible" && name != "scalar") tables.push_back(table);
  }
  if (tables.empty()) tables.push_back(BestKernels());
  return tables;
}

// Registers `run(state, table, cold)` for every instruction set, warm and cold.
template <typename Run>
void ForEveryTable(const std::string& name, Run run) {
  for (size_t i = 0; i < KernelTableCount(); ++i) {
    const KernelTable* table = KernelTableAt(i);
    for (const bool cold : {false, true}) {
      const std::string full = name + "/" + table->name + (cold ? "/cold" : "/warm");
      auto* registered =
          benchmark::RegisterBenchmark(full.c_str(), [=](benchmark::State& state) { run(state, *table, cold); });
      registered->UseManualTime()->Unit(benchmark::kMicrosecond);
      // Cold calls spend their time in the eviction, so their number is fixed instead of grown to fill half a second.
      if (cold) registered->Iterations(25);
    }
  }
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_BENCH_KERNELS_KERNEL_BENCH_H_
