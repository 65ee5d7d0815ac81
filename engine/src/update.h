// Time: what one call of the host makes of a tick and a frame.
#ifndef DCLOTH_ENGINE_SRC_UPDATE_H_
#define DCLOTH_ENGINE_SRC_UPDATE_H_

#include "engine/src/cloth.h"

namespace dcloth::engine {

// All three return false, and change nothing, when the pose is not usable. Other arguments have been checked.

// The calls that leave time to the host: one tick now; a frame between the last two ticks.
bool TickCloth(Cloth* cloth, const dcloth_pose& pose, uint32_t stages, dcloth_timer* timer);
bool SkinCloth(Cloth* cloth, const dcloth_pose& pose, float blend, const dcloth_output& output, dcloth_timer* timer);

// A frame: ticks that are due, then drawing where `output` is not null.
bool UpdateCloth(Cloth* cloth, const dcloth_pose& pose, const dcloth_frame& frame, const dcloth_output* output,
                 dcloth_timer* timer);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_UPDATE_H_
