// The garments under models/ in every precision, with the motion that lies beside them, and what hosts do to poses:
// turn, move, exaggerate, deform.
//
// Models are converted when they are first asked for, or read from the folder that DCLOTH_GARMENT_MODELS names: as
// GARMENT.PRECISION.dcloth, what `dcloth convert --precision PRECISION` makes of the bundle. Under an emulator, that
// saves most of the time of a short test.
#ifndef DCLOTH_TESTS_STABILITY_GARMENT_H_
#define DCLOTH_TESTS_STABILITY_GARMENT_H_

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <string>
#include <vector>

#include "converter/bundle.h"
#include "converter/precision.h"
#include "converter/rollout.h"

namespace dcloth::stability {

using Matrix = Eigen::Matrix4d;
using Pose = std::vector<Matrix>;  // joint to world, metres
using Motion = std::vector<Pose>;  // one pose a tick

// What the transforms below need to know of a character.
struct Rig {
  size_t hips = 0;
  std::vector<Matrix> bind;     // joint to world
  std::vector<size_t> parents;  // of each joint; the hips' own index for the hips
};

// A bundle names joints but no tree. A child's origin stands still in its parent's frame: joints are attached
// to the tree, hips first, where they move least over all motions. `motions` have one joint order.
std::vector<size_t> InferParents(const std::vector<const Motion*>& motions, size_t hips);

// Rotation about the vertical through the hips' ground point.
Pose Turned(const Pose& pose, const Rig& rig, double radians);

Pose Moved(const Pose& pose, const Eigen::Vector3d& offset);

// Every joint's rotation against its parent, as seen from the bind pose, times `factor` in angle; the hips
// keep heading and place, and lean `factor` times as far. Bones keep their length.
Pose Exaggerated(const Pose& pose, const Rig& rig, double factor);

// The largest rotation of a joint against its parent, away from the bind pose, in radians; the hips' lean is one of
// them.
double LargestTurn(const Pose& pose, const Rig& rig);

// `linear` is multiplied to every joint's linear part in the joint's own frame: scale, shear. Origins stay.
Pose Deformed(const Pose& pose, const Eigen::Matrix3d& linear);

// Where the character stands and looks: about +Y only, as the engine's heading frame (NETWORK.md, "Pose").
Matrix GroundFrame(const Pose& pose, const Rig& rig);

using converter::Precision;

using converter::kPrecisions;

// A bundled sequence with the simulated truth.
struct Clip {
  std::string name;
  Motion motion;             // joints in the models' order
  std::vector<float> truth;  // [frames, n, 3] world, metres
};

struct Garment {
  std::string name;
  converter::Bundle bundle;
  Rig rig;
  std::vector<Clip> clips;
  double size_m = 0;  // farthest template vertex from the hips' bind position

  // Throws converter::Error.
  const converter::OpenModel& model(Precision precision) const;
  // The same in every precision.
  const std::vector<std::string>& joint_names() const { return model(Precision::kInt8).joint_names(); }
  size_t vertex_count() const { return bundle.vertex_count(); }

 private:
  mutable std::array<std::unique_ptr<converter::OpenModel>, 3> models_;  // in the order of kPrecisions
};

// Folders of models/ that hold a bundle of their own name, sorted.
std::vector<std::string> GarmentNames();

// Reads once per process. Throws converter::Error, also where a garment has no sequences with
// truth.
const Garment& LoadGarment(const std::string& name);

}  // namespace dcloth::stability

#endif  // DCLOTH_TESTS_STABILITY_GARMENT_H_
