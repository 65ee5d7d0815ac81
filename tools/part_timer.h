// Per-kernel times out of the engine's per-step timer: the engine asks the clock at the end of every piece of a tick, so
// a clock that remembers what had been added when it was asked knows them all. Without a timer a piece costs a comparison.
#ifndef DCLOTH_TOOLS_PART_TIMER_H_
#define DCLOTH_TOOLS_PART_TIMER_H_

#include <array>
#include <cstddef>
#include <cstdint>

#include "converter/model_work.h"
#include "dcloth/dcloth.h"
#include "tools/timing.h"

namespace dcloth::tools {

using PartTimes = std::array<uint64_t, converter::kWorkPartCount>;  // ns

struct TimedParts {
  StepTimes steps{};
  PartTimes parts{};
  bool whole = false;  // parts is filled: each piece ran once and whole, or in turns with another; not where a tick is
                       // spread over frames
};

class PartTimer {
 public:
  // `stages`: what runs, DCLOTH_STAGES_*.
  explicit PartTimer(uint32_t stages);
  PartTimer(const PartTimer&) = delete;
  PartTimer& operator=(const PartTimer&) = delete;

  dcloth_timer* get() { return &timer_; }
  TimedParts Take();  // since the last call

 private:
  static constexpr size_t kMost = 256;  // calls of the clock that are told apart; a whole tick in turns makes some 120

  static uint64_t Now(void* self);

  dcloth_timer timer_{};
  uint32_t stages_;
  size_t count_ = 0;
  std::array<StepTimes, kMost + 1> before_{};  // elapsed[] when the clock was asked
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PART_TIMER_H_
