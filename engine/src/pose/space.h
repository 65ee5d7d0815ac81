// The host's axes and unit of length: G_host in, G in the model's space out, and the way back as a matrix
// that skinning takes in for nothing.
#ifndef DCLOTH_ENGINE_SRC_POSE_SPACE_H_
#define DCLOTH_ENGINE_SRC_POSE_SPACE_H_

#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/diagnostic.h"
#include "engine/src/pose/affine.h"

namespace dcloth::engine {

// Host axis that each model axis points along: model vector a is host vector h with h[axis[i]] = sign[i]
// a[i].
struct Space {
  uint8_t axis[3] = {0, 1, 2};
  double sign[3] = {1, 1, 1};
  double metres_per_unit = 1;
  bool converts_joints = true;  // joint frames are converted with the world
  bool mirrored = false;        // left-handed: triangles' cross products point inwards
};

// False, with the field that is wrong, where two axes are the same or a number is none of those allowed; then `space`
// stays.
bool MakeSpace(const dcloth_space& described, Space* space, format::Diagnostic* diagnostic);

// A joint's matrix as the host gives it, in the model's space. Exact but for the unit.
Affine FromHost(const Space& space, const Affine& host);

// The way back, for a host whose joint frames are converted with the world. Exact but for the unit.
Affine JointToHost(const Space& space, const Affine& matrix);

// A vector of the host's in the model's space, metres for units.
void VectorFromHost(const Space& space, const float (&host)[3], double (&vector)[3]);

// A skinning matrix, model space to model space, that ends in the host's instead. Exact but for the unit.
Affine ToHost(const Space& space, const Affine& matrix);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_POSE_SPACE_H_
