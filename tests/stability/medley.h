// Motion without end out of a few bundled clips: pieces at random places, sped up or slowed down, blended
// into each other, turned so that the character stays near the origin (far from it a world position has fewer
// bits, which would look like drift). Every transition is continuous in pose and root velocity: the garment
// is never teleported.
#ifndef DCLOTH_TESTS_STABILITY_MEDLEY_H_
#define DCLOTH_TESTS_STABILITY_MEDLEY_H_

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "tests/stability/garment.h"

namespace dcloth::stability {

class Medley {
 public:
  // The same garment and seed give the same motion. Joints must be rigid (no scale); throws
  // std::invalid_argument.
  Medley(const Garment& garment, uint64_t seed);

  Pose Next();

 private:
  struct Joint {
    Eigen::Quaterniond rotation;
    Eigen::Vector3d origin;
  };
  struct Frame {
    std::vector<Joint> joints;  // relative to the ground frame
    double yaw;                 // of the ground frame, unwrapped along the clip
    Eigen::Vector3d ground;
  };
  struct Playhead {
    size_t clip = 0;
    double position = 0, speed = 1, turn = 0;  // frames, frames a tick, rad a tick
  };

  double Uniform(double low, double high);
  Playhead Draw();
  Frame Sample(const Playhead& head) const;
  double Left(const Playhead& head) const;  // ticks until the clip ends

  const Rig& rig_;
  std::vector<std::vector<Frame>> clips_;
  uint64_t random_;
  Playhead playing_, coming_;
  size_t blended_ = 0, played_ = 0, length_ = 0;  // ticks: into the blend, into the piece, of the piece
  double yaw_ = 0;
  Eigen::Vector3d ground_ = Eigen::Vector3d::Zero();
};

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_MEDLEY_H_
