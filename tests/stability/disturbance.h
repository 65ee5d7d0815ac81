// A garment that is disturbed in the middle of a clip, beside one that is not.
#ifndef DCLOTH_TESTS_STABILITY_DISTURBANCE_H_
#define DCLOTH_TESTS_STABILITY_DISTURBANCE_H_

#include <functional>
#include <vector>

#include "tests/stability/garment.h"
#include "tests/stability/player.h"

namespace dcloth::stability {

constexpr size_t kDisturbedFrom = 45, kDisturbedUntil = 60;  // ticks of a clip

// What the host does in place of one tick and frame.
using Host = std::function<void(Player* player, const Motion& motion, size_t frame)>;

struct Outcome {
  double worst_reach_m = 0;  // during the disturbance and after it
  double largest_mm = 0;     // mean vertex distance to the undisturbed run, largest after the disturbance
  double left_mm = 0;        // the same over the half second that starts one second after it, mean
  double excess_mm = 0;      // |E_d - that of the undisturbed run| over the same half second, mean
  std::vector<double> tick_ms;
};

// Over all clips of the garment: the worst of each. `host` acts in ticks [kDisturbedFrom, kDisturbedUntil).
Outcome Disturb(const Garment& garment, Precision precision, const Host& host);

// How far Exaggerated(factor) leads while the garment is disturbed: the largest distance of a pose feature
// from the middle of its trained range, over half of that range (1 is the border). Elements of a rotation end
// at 1, so that ratio cannot grow with the angle, and a range that spans them cannot be left at all: of the
// factors 2, 3, ... 8 it is the one that leads farthest, and `turn` says how far joints turn then (radians).
struct Reach {
  double factor = 0;
  double ratio = 0;
  double turn = 0;
};
Reach FactorBeyondTraining(const Garment& garment);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_DISTURBANCE_H_
