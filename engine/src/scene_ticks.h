// Who ticks in this frame: of those whose tick is due, the longest waiting first, while the budget lasts.
#ifndef DCLOTH_ENGINE_SRC_SCENE_TICKS_H_
#define DCLOTH_ENGINE_SRC_SCENE_TICKS_H_

#include "engine/src/scene.h"

namespace dcloth::engine {

// Fills ticks, held, microseconds, late and stale of each character for a frame of `seconds`; returns the ticks' cost,
// at most `left` (0 where that is negative). A tick that does not fit lets smaller ones pass, and is first in its turn:
// ChooseLevels gives no level whose tick is longer than `left`, so nobody waits longer than the others take.
double GrantTicks(Scene* scene, double seconds, double left);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_SCENE_TICKS_H_
