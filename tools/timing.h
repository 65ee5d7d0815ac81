// Measuring: a clock, percentiles, per-step times of the engine, cold caches.
#ifndef DCLOTH_TOOLS_TIMING_H_
#define DCLOTH_TOOLS_TIMING_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <vector>

#include "dcloth/dcloth.h"

namespace dcloth::tools {

// Monotonic; about 25 ns a call, against steps of 10 us and more.
uint64_t NowNanoseconds();

// Of this thread's work alone: what passes beside it is time that the system took. On Windows, whose clock of a thread
// is too coarse for a frame, the same as above.
uint64_t ThreadNanoseconds();

// Whether the system took more of a piece of work than a clock's own cost and the ticks of its timer: 0.02 ms and a
// twentieth. Nanoseconds, of the two clocks above.
bool IsInterrupted(uint64_t wall, uint64_t work);

// Nearest rank: the smallest sample that at least q of all samples do not exceed. All zero without samples.
struct Percentiles {
  double p50 = 0, p95 = 0, p99 = 0, max = 0;
};
Percentiles PercentilesOf(std::span<const double> samples);

using StepNames = std::array<const char*, DCLOTH_STEP_COUNT>;
constexpr StepNames kStepNames = {"pose",         "static",   "skeleton", "mesh",
                                  "displacement", "skinning", "normals",  "penetration"};
using StepTimes = std::array<uint64_t, DCLOTH_STEP_COUNT>;  // ns

// A dcloth_timer on NowNanoseconds. Not copyable in spirit: hand out get() while this lives.
class StepTimer {
 public:
  StepTimer();
  dcloth_timer* get() { return &timer_; }
  StepTimes Take();  // what was added since the last call

 private:
  dcloth_timer timer_{};
};

// The weights of a game's cloth do not stay in cache while the rest of the frame runs.
class CacheEvictor {
 public:
  // Writes these bytes back to memory and drops them from all caches, line by line; then reads 8 MB, so that code,
  // stack and tables come from the last level, not from memory. Where the processor has no such instruction:
  // EvictAll().
  void Evict(std::initializer_list<std::span<const std::byte>> memories);

  // Whatever anyone has in the caches: reads more than twice the last level (writing would leave dirty lines for the
  // timed part to write back), which a server shares with its neighbours and takes tens of milliseconds to fill.
  void EvictAll();
  static uint64_t AllBytes();  // that EvictAll reads

 private:
  void Read(uint64_t bytes, std::vector<uint64_t>* memory);

  std::vector<uint64_t> all_, near_;
  volatile uint64_t sink_ = 0;  // keeps the reads
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_TIMING_H_
