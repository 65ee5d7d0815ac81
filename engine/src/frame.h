// What a frame draws: skinning, then what keeps the garment outside of the body, then normals. It lies in no room, as
// it needs both the one that draws and the one that looks at what was drawn.
#ifndef DCLOTH_ENGINE_SRC_FRAME_H_
#define DCLOTH_ENGINE_SRC_FRAME_H_

#include "engine/src/cloth.h"

namespace dcloth::engine {

// Draws the garment as it was `behind` ticks before the newest complete one, 0 to 2, or at the oldest tick
// where none is so old.
void DrawFrame(Cloth* cloth, const SkinPose& skin, double behind, const dcloth_output& output, Stopwatch* watch);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_FRAME_H_
