// Idle freeze: a garment whose character stands still and which has come to rest itself is not computed any more.
//
// Still is measured from the pose of one tick on, so that a slow drift wakes the cloth as a fast one does. Settled is
// measured from tick to tick. Rejected: to look at the pose alone (a skirt swings on for a second after its wearer has
// stopped) and at the recurrent state (it may turn where the garment rests).
#ifndef DCLOTH_ENGINE_SRC_IDLE_H_
#define DCLOTH_ENGINE_SRC_IDLE_H_

#include "engine/src/cloth.h"

namespace dcloth::engine {

// Half a second at 30 Hz of ticks that are still and settled, one after another.
constexpr uint32_t kIdleTicks = 15;
// Of a joint from the pose it is held against: elements of its axes (a millimetre at a metre), metres in the world.
constexpr double kStillAxes = 1e-3;
constexpr double kStillMetres = 5e-4;
// Of each coordinate of displacement and pivots in a tick, metres.
constexpr float kSettledMetres = 5e-5f;

inline bool IsFrozen(const Cloth& cloth) { return cloth.idle_ticks == kIdleTicks; }

// `pose` is the idle pose but for what does not matter.
bool IsStill(const Cloth& cloth, const Affine* pose);

// A tick begins on `pose`; later, it is complete. A tick that moved or was not settled begins the count anew.
void CountTickBegun(Cloth* cloth, const Affine* pose);
void CountTickDone(Cloth* cloth);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_IDLE_H_
