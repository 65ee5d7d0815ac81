// Levels that a scene can afford in the mean: raises by worth until the frames are full.
#ifndef DCLOTH_ENGINE_SRC_SCENE_LEVELS_H_
#define DCLOTH_ENGINE_SRC_SCENE_LEVELS_H_

#include "engine/src/scene.h"

namespace dcloth::engine {

// Sets the level of each character that is not idle; `left` is what a frame has for ticks, microseconds.
//
// A level's share of a frame is its ticks per frame, over how many such ticks fit into one frame (harmonic packing:
// what adds up to 1 can be packed whole, tick by tick). Everyone starts frozen; the raise with the most error removed
// times importance, per share, comes first. A level once held is kept until the frames overflow, and is worth a
// quarter more than another's: a stage that stops and starts forgets its motion. Cost: N log N.
void ChooseLevels(Scene* scene, double left);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_SCENE_LEVELS_H_
