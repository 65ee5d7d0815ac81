// Times the pieces of a call with the host's clock and tells a dcloth_timer of each; does nothing without a timer or a
// clock.
#ifndef DCLOTH_ENGINE_SRC_BASE_STOPWATCH_H_
#define DCLOTH_ENGINE_SRC_BASE_STOPWATCH_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth.h"

namespace dcloth::engine {

class Stopwatch {
 public:
  explicit Stopwatch(dcloth_timer* timer) : timer_(timer != nullptr && timer->now != nullptr ? timer : nullptr) {
    if (timer_ == nullptr) return;
    constexpr size_t kWithPiece = offsetof(dcloth_timer, piece) + sizeof(timer->piece);
    tells_ = timer_->struct_size >= kWithPiece && timer_->piece != nullptr;
    last_ = timer_->now(timer_->context);
  }

  // Everything since the last lap was `piece` and belonged to `step`, a DCLOTH_STEP_*.
  void Lap(int step, const char* piece) {
    if (timer_ == nullptr) return;
    const uint64_t now = timer_->now(timer_->context);
    timer_->elapsed[step] += now - last_;
    if (tells_) timer_->piece(timer_->context, piece, now - last_);
    last_ = now;
  }

 private:
  dcloth_timer* timer_;
  bool tells_ = false;
  uint64_t last_ = 0;
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BASE_STOPWATCH_H_
