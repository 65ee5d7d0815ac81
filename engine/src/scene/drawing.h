// How each character of a scene is drawn: its detail, for many frames, and what is drawn of it in this one.
//
// Everyone begins with the cheapest drawing and no ticks. The step up that removes most harm per microsecond comes
// first, whether it draws more of a character or ticks it at a higher level, so that far characters lose detail long
// before a near one does and nobody is drawn in full while others stand still. What a detail does not draw in every
// frame alternates: the longest waiting goes first.
#ifndef DCLOTH_ENGINE_SRC_SCENE_DRAWING_H_
#define DCLOTH_ENGINE_SRC_SCENE_DRAWING_H_

#include "engine/src/scene/scene.h"

namespace dcloth::engine {

struct DrawingCosts {
  double mean;     // of a frame, microseconds
  double longest;  // of a frame in which the dearest of what alternates is drawn
};

// Sets each character's detail so that a mean frame and the ticks that are worth more take at most `budget`
// microseconds, if the lowest details do. A detail once left is taken again when there is a tenth of the budget to
// spare. ChooseLevels counts ticks exactly then. Cost: N log N.
DrawingCosts ChooseDetails(Scene* scene, double budget);

// Sets what is drawn of each character in this frame; returns its cost in microseconds, at most the `longest` above.
double GrantDrawing(Scene* scene);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_SCENE_DRAWING_H_
