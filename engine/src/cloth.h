// One garment on one character: the memory of an instance and its reset. Ticks are in network/schedule.h, time in
// update.h, drawing in frame.h.
#ifndef DCLOTH_ENGINE_SRC_CLOTH_H_
#define DCLOTH_ENGINE_SRC_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/diagnostic.h"
#include "engine/format/fit_file.h"
#include "engine/src/base/stopwatch.h"
#include "engine/src/contact/contact.h"
#include "engine/src/network/mesh_stage.h"
#include "engine/src/network/patch_stage.h"
#include "engine/src/network/pose_stages.h"
#include "engine/src/network/tick_work.h"
#include "engine/src/pose/pose.h"
#include "engine/src/time/frame_clock.h"

namespace dcloth::engine {

// Results of ticks that an instance keeps: two to draw between, and a third that is in work or, drawn late,
// still needed.
constexpr uint32_t kTickSlots = 3;

constexpr double kFastestWind = 100;  // m/s

struct Cloth {
  const format::ModelView* model;    // what is drawn: `trained`, or `fitted_model`
  const format::ModelView* trained;  // as created
  format::ModelView* fitted_model;   // its cut moved onto another body (fit.h)
  const format::FitJoint* fit;  // [joint_count], to a character; null without. `rig` and `model` are then the fit's
  Space told_space;             // of a fitted cloth, without the character's scale
  HostRig rig;                  // outlives resets
  float wind[3];                // the host's units a second along its axes; outlives resets
  RootMotion root;
  FrameClock clock;
  TickWork work;
  Affine* skin_joints;  // [joint_count], SkinPose::joints of the tick or frame that is made; before, a tick's pose
  Affine* pose_older;   // [joint_count], the pose of the update before the last one
  Affine* pose_before;  // [joint_count], the pose of the last update
  Affine* pose_now;     // [joint_count], the pose of this one
  Affine* idle_pose;    // [joint_count], of the tick since which the pose has not moved
  float* idle_start;    // D and what made delta in the first of the idle ticks, see time/idle.h
  float* matrices;      // [m, 12], scratch of a frame
  float* features;      // x [d], kept from tick to tick
  float* hidden;        // [padded width] of the static stage
  int16_t* quantized;   // activations of the widest int8 layer
  SkeletonScratch skeleton;
  MeshMemory mesh;
  PatchMemory patches;
  ContactMemory contact;
  ContactClock contact_clock;
  float* coefficients;              // see network/displacement.h; P is the skeleton stage's state
  float* increments[kTickSlots];    // D of a tick
  float* displacement[kTickSlots];  // delta of a tick; null where no stage makes one
  uint32_t newest;                  // slot of the newest complete tick; older ones lie before it, around the corner
  uint32_t tick_count;              // complete since the reset, up to kTickSlots
  uint32_t stages;                  // of the newest tick, in work or not; all stages after a reset
  uint32_t idle_ticks;              // since idle_pose, up to kIdleTicks: then the cloth is frozen
  float work_done;                  // by the last update, 1 for a whole tick
  double older_step;                // ticks from pose_older to pose_before; 0 where one motion does not hold both
};

// As the host told it.
inline const Space& ToldSpace(const Cloth& cloth) { return cloth.fit != nullptr ? cloth.told_space : cloth.rig.space; }

// Slot of the complete tick `back` before the newest one, or of the oldest there is.
uint32_t SlotBefore(const Cloth& cloth, uint32_t back);

// Slot that the tick in work fills.
inline uint32_t NextTick(const Cloth& cloth) { return (cloth.newest + 1) % kTickSlots; }

// The one place that knows an instance's layout: with `storage` null it only returns the size.
size_t PlaceCloth(const format::ModelView& model, void* storage, Cloth** cloth);  // then PrepareContact

void ResetCloth(Cloth* cloth);

// Refused where a number is not finite or the wind is faster than kFastestWind, told in `diagnostic`.
bool TakeWind(const float* wind, Cloth* cloth, format::Diagnostic* diagnostic);

uint32_t ModelStages(const format::ModelView& model);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CLOTH_H_
