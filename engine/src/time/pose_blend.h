// The pose at a tick that falls between two frames.
#ifndef DCLOTH_ENGINE_SRC_TIME_POSE_BLEND_H_
#define DCLOTH_ENGINE_SRC_TIME_POSE_BLEND_H_

#include <cstddef>

#include "engine/src/pose/affine.h"

namespace dcloth::engine {

// The poses of three frames, [joint_count] each.
struct PoseHistory {
  const Affine* older;
  const Affine* before;
  const Affine* now;
  double older_gap;  // time from older to before over that from before to now; 0 where older says nothing
};

// The pose `fraction` of the way from before to now, in [0, 1]: on the parabola through the three frames,
// which leaves the third derivative of the motion as error; without the older one on the straight line or the
// arc, which leaves the second. Straight blending alone is rejected: on the bundled skirt's walk it moved
// ticks by 0.83 mm on average at 24 Hz (0.34 with the parabola) and by 0.45 mm at most at 144 Hz (0.12). So is
// a cubic through four frames: at 24 Hz 8.7 mm at most in place of 10.5 on run_stop, 48.5 in place of 40.2 on a
// recorded run; a curve through all frames, later ones too, still leaves 7.3 and 31.6 (tests/scene/rate_test.cc).
// The lengths of axes go straight. Matrices that are no right-handed frame (collapsed, mirrored) are blended
// straight element by element. `out` is none of the three.
void PoseBetween(const PoseHistory& history, double fraction, size_t joint_count, Affine* out);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_TIME_POSE_BLEND_H_
