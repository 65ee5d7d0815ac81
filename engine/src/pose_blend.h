// The pose at a tick that falls between two frames.
#ifndef DCLOTH_ENGINE_SRC_POSE_BLEND_H_
#define DCLOTH_ENGINE_SRC_POSE_BLEND_H_

#include <cstddef>

#include "engine/src/affine.h"

namespace dcloth::engine {

// out[j] = from[j] moved towards to[j] by `fraction` in [0, 1]: rotations along the arc between them, the lengths of the
// axes and positions straight. Matrices without three axes of a right-handed frame (collapsed, mirrored) are blended
// element by element. `out` may be `from` or `to`.
void BlendPoses(const Affine* from, const Affine* to, double fraction, size_t joint_count, Affine* out);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_POSE_BLEND_H_
