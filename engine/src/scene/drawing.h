// How each character of a scene is drawn: its detail, for many frames, and what is drawn of it in this one.
//
// Drawing may take half of the budget, or what ticks at the wanted levels leave of it if that is more. What is saved
// per harm done decides who is drawn with less, so that far characters lose detail long before a near one does. What a
// detail does not draw in every frame alternates: the longest waiting goes first.
#ifndef DCLOTH_ENGINE_SRC_SCENE_DRAWING_H_
#define DCLOTH_ENGINE_SRC_SCENE_DRAWING_H_

#include "engine/src/scene/scene.h"

namespace dcloth::engine {

struct DrawingCosts {
  double mean;     // of a frame, microseconds
  double longest;  // of a frame in which the dearest of what alternates is drawn
};

// Sets each character's detail so that a mean frame takes at most `room` microseconds, if the lowest details do. A
// detail once left is taken again when there is a tenth of room to spare. Cost: N log N.
DrawingCosts ChooseDetails(Scene* scene, double room);

// Sets what is drawn of each character in this frame; returns its cost in microseconds, at most the `longest` above.
double GrantDrawing(Scene* scene);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_SCENE_DRAWING_H_
