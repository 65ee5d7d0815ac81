// Adds the host clock's time between laps to the steps of a dcloth_timer; does nothing without a timer or a clock.
#ifndef DCLOTH_ENGINE_SRC_BASE_STOPWATCH_H_
#define DCLOTH_ENGINE_SRC_BASE_STOPWATCH_H_

#include <cstdint>

#include "dcloth/dcloth.h"

namespace dcloth::engine {

class Stopwatch {
 public:
  explicit Stopwatch(dcloth_timer* timer) : timer_(timer != nullptr && timer->now != nullptr ? timer : nullptr) {
    if (timer_ != nullptr) last_ = timer_->now(timer_->context);
  }

  // Everything since the last lap belonged to `step`, a DCLOTH_STEP_*.
  void Lap(int step) {
    if (timer_ == nullptr) return;
    const uint64_t now = timer_->now(timer_->context);
    timer_->elapsed[step] += now - last_;
    last_ = now;
  }

 private:
  dcloth_timer* timer_;
  uint64_t last_ = 0;
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BASE_STOPWATCH_H_
