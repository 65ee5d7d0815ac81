#include "engine/src/time/frame_clock.h"

namespace dcloth::engine {
namespace {

double Larger(double a, double b) { return a > b ? a : b; }

}  // namespace

void FrameClock::Pass(double step) {
  step_ = step < kLongestGap ? step : kLongestGap;
  lag_ = Larger(lag_ - kLagLeak * step_, 0);
}

DueTicks FrameClock::Advance(double step) {
  if (!started_) {
    Restart();
    step_ = 0;
    return {1, 0, 0, {1.0, 1.0}};
  }
  Pass(step);
  if (tick_waits()) {
    if (step_ == 0) return {};
    const double waited = Larger(since_ + waited_ + step_ - 1, 0);
    since_ = waited_ = 0;
    return {1, 0, waited, {1.0, 1.0}};
  }
  const double phase = since_ + step_;
  // Up to 2^20 + 1 and not negative: since_ is above -kTickTolerance.
  const auto due = static_cast<uint32_t>(phase + kTickTolerance);
  since_ = phase - due;
  DueTicks ticks = {due < kMaxTicks ? due : kMaxTicks, due > kMaxTicks ? due - kMaxTicks : 0, 0, {1.0, 1.0}};
  for (uint32_t i = 0; i < ticks.count; ++i) {
    const double ago = since_ + (ticks.count - 1 - i);
    if (ago > kTickTolerance) ticks.fraction[i] = Larger(1 - ago / step_, 0);
  }
  return ticks;
}

uint32_t FrameClock::TicksDue(double step) const {
  FrameClock later = *this;
  return later.Advance(step).count;
}

void FrameClock::Hold(double step) {
  if (!started_) return;
  Pass(step);
  since_ += step_;
  if (!tick_waits()) return;
  waited_ += since_ - 1;
  if (waited_ > kLongestGap) waited_ = kLongestGap;
  since_ = 1;
}

void FrameClock::Rest(double step) {
  Pass(step);
  since_ = 1;
  waited_ = -1;
}

void FrameClock::Restart() {
  started_ = true;
  since_ = 0;
  waited_ = 0;
  lag_ = 0;
}

void FrameClock::Resume(double since, double waited, double lag) {
  started_ = true;
  since_ = since;
  waited_ = waited;
  lag_ = lag;
}

double FrameClock::Behind(bool in_work) {
  const double age = Larger(since_, 0) + (in_work ? 1 : 0);
  lag_ = Larger(lag_, age);
  return lag_ - age;
}

}  // namespace dcloth::engine
