// Idle freeze: a garment whose character stands still and which has come to rest itself is not computed any more.
//
// Still is measured from the pose of one tick on, so that a slow drift wakes the cloth as a fast one does. Settled is
// measured from tick to tick, which a swing does not pass however it ends, and over the half second as a whole, which a
// creep does not pass. Of the half second's start only the basis' coefficients are kept, a kilobyte: when it is over,
// what they have changed by, times the basis, is how far each vertex went, at the price of one such sum. Patches come
// to rest by themselves (NETWORK.md, "Rest"), and are settled when they have. Rejected: to look at the pose alone (a
// skirt swings on for a second after its wearer has stopped), at the recurrent state (it may turn where the garment
// rests), at the sum of the steps (a tremble that leads nowhere adds up), and to keep the displacement itself (twelve
// bytes a vertex in each instance).
#ifndef DCLOTH_ENGINE_SRC_TIME_IDLE_H_
#define DCLOTH_ENGINE_SRC_TIME_IDLE_H_

#include "engine/src/cloth.h"

namespace dcloth::engine {

// Half a second at 30 Hz of ticks that are still and settled, one after another.
constexpr uint32_t kIdleTicks = 15;
// Of a joint from the pose it is held against: elements of its axes (a millimetre at a metre), metres in the world.
constexpr double kStillAxes = 1e-3;
constexpr double kStillMetres = 5e-4;
// Of these, for patches: cloth that remembers wakes when the cloth that never froze does, or they part.
constexpr double kStillForPatches = 0.1;
// Of each coordinate of displacement and pivots, in a tick and in the half second, metres.
constexpr float kSettledMetres = 5e-5f;

inline bool IsFrozen(const Cloth& cloth) { return cloth.idle_ticks == kIdleTicks; }

// `pose` is the idle pose but for what does not matter, and the wind that of the newest tick.
bool IsStill(const Cloth& cloth, const Affine* pose);

// Floats of Cloth::idle_start: [D, 3 a bone | c, basis rows], c zero where the tick's level stops.
size_t IdleStartFloats(const format::ModelView& model);

// A tick begins on `pose`; later, it is complete. A tick that moved or was not settled begins the count anew, and so
// does a half second that crept.
void CountTickBegun(Cloth* cloth, const Affine* pose);
void CountTickDone(Cloth* cloth);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_TIME_IDLE_H_
