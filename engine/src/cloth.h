// One garment on one character: the memory of an instance and the order of a tick and a frame.
#ifndef DCLOTH_ENGINE_SRC_CLOTH_H_
#define DCLOTH_ENGINE_SRC_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/mesh_stage.h"
#include "engine/src/pose.h"
#include "engine/src/skeleton_stage.h"

namespace dcloth::engine {

struct Cloth {
  const format::ModelView* model;
  RootMotion root;
  Affine* joints;      // [joint_count], scratch of a tick and of a frame
  float* matrices;     // [m, 12], scratch of a frame
  float* features;     // x [d]
  float* hidden;       // [padded width] of the static stage
  int16_t* quantized;  // activations of the widest int8 layer
  SkeletonScratch skeleton;
  MeshMemory mesh;
  float* coefficients;     // see coefficients.h; P is the skeleton stage's state
  float* increments[2];    // D of the last tick at [current], of the one before at the other
  float* displacement[2];  // delta likewise; null without a basis
  uint32_t current;
  uint32_t tick_count;  // since the reset, up to 2
  uint32_t stages;      // of the last tick; all after a reset
};

// The one place that knows an instance's layout: with `storage` null it only returns the size.
size_t PlaceCloth(const format::ModelView& model, void* storage, Cloth** cloth);

void ResetCloth(Cloth* cloth);

uint32_t ModelStages(const format::ModelView& model);

// Both return false, and change nothing, when the pose is not usable. Other arguments have been checked.
bool TickCloth(Cloth* cloth, const dcloth_pose& pose, uint32_t stages, dcloth_timer* timer);
bool SkinCloth(Cloth* cloth, const dcloth_pose& pose, float blend, const dcloth_output& output, dcloth_timer* timer);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CLOTH_H_
