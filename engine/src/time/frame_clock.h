// When ticks are due and which moment of the network a frame draws. Unit: ticks.
//
// Ticks lie on a grid of their own; frames come when they come. A frame draws the displacement of `lag` ticks
// ago, and the lag is the smallest that never runs out of results: it grows at once where a frame needs more,
// and shrinks by kLagLeak of the time that passes. A host at 30 Hz thus draws without delay, at 60 Hz half a
// tick late, at any other rate up to one tick late, and small changes of the frame time never make the cloth
// stop and go. Rejected: a lag of one tick always (twice the delay at 60 Hz) and one from the last frame time
// alone (stop and go wherever frames and ticks do not fall together, at 144 Hz for instance).
#ifndef DCLOTH_ENGINE_SRC_TIME_FRAME_CLOCK_H_
#define DCLOTH_ENGINE_SRC_TIME_FRAME_CLOCK_H_

#include <cstdint>

namespace dcloth::engine {

// A tick that is due within this time runs now, with the pose of now: frame times are rounded, 33 us do not
// matter.
constexpr double kTickTolerance = 1e-3;
constexpr double kLagLeak = 1e-3;
// Most ticks that one update runs; older ones that a hitch left due are skipped.
constexpr uint32_t kMaxTicks = 2;
// Longer gaps are all the same, and the sum of a gap and a position on the grid stays exact enough.
constexpr double kLongestGap = 1 << 20;

struct DueTicks {
  uint32_t count;    // to run now, up to kMaxTicks
  uint32_t skipped;  // due before them
  double waited;     // by how much the first is late because frames held it back, in ticks
  // Of tick i of `count`: where it lies between the last frame (0) and this one (1).
  double fraction[kMaxTicks];
};

class FrameClock {
 public:
  // The first call after construction makes one tick due at once, whatever `step`. `step` is the frame time
  // in ticks, at least 0 and finite.
  DueTicks Advance(double step);

  // How many ticks Advance(step) would make due now.
  uint32_t TicksDue(double step) const;

  // A frame in which no tick may start: the one that falls due waits for the next Advance with time, and the grid
  // then starts anew with it.
  void Hold(double step);

  // A frame of a frozen cloth: its tick waits too, but the pose of a tick ago is as good as known.
  void Rest(double step);

  // Whether the next Advance with time starts a tick, however short it is.
  bool tick_waits() const { return !started_ || since_ >= 1 - kTickTolerance; }

  // A tick has just run outside of Advance: the next one is due a whole tick later.
  void Restart();

  // How many ticks behind the newest complete one this frame draws. `in_work` when that one is not the newest
  // due.
  double Behind(bool in_work);

  // Goes on as a clock did that was at `since`, had waited and had this lag, after its first tick.
  void Resume(double since, double waited, double lag);

  double lag() const { return lag_; }
  double since() const { return since_; }
  double waited() const { return waited_; }
  double step() const { return step_; }

 private:
  void Pass(double step);

  bool started_ = false;
  double since_ = 0;   // since the newest due tick, -kTickTolerance to 1
  double waited_ = 0;  // since then beyond since_; begins at -1 after a rest
  double step_ = 0;    // of the last Advance
  double lag_ = 0;
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_TIME_FRAME_CLOCK_H_
