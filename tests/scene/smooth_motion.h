// A bundled motion between its poses: smooth, so that what frames at another rate see of it is well defined.
#ifndef DCLOTH_TESTS_SCENE_SMOOTH_MOTION_H_
#define DCLOTH_TESTS_SCENE_SMOOTH_MOTION_H_

#include "tests/stability/garment.h"

namespace dcloth::stability {

// The natural cubic spline through poses `step` seconds apart, element by element: two derivatives are continuous, the
// third is constant between poses. Axes are made orthonormal again; origins of joints are the spline's.
class SmoothMotion {
 public:
  SmoothMotion(Motion poses, double step);

  double seconds() const { return step_ * static_cast<double>(poses_.size() - 1); }
  Pose At(double seconds) const;

  // The largest third derivative of a joint's origin within [from, to], m/s^3.
  double LargestJerk(size_t joint, double from, double to) const;

 private:
  size_t Before(double seconds) const;  // the pose before, not the last one

  Motion poses_, curvature_;  // second derivatives at the poses
  double step_;
};

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_SCENE_SMOOTH_MOTION_H_
