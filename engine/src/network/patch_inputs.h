// What a patch reads of its cloth and of the body (NETWORK.md, "Patch stage"): its frame, its points without
// displacement, where they were, and the limbs beside them. The same bits on every instruction set.
//
// Positions are metres from the hips of the tick, in the world's axes.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_PATCH_INPUTS_H_
#define DCLOTH_ENGINE_SRC_NETWORK_PATCH_INPUTS_H_

#include <cstddef>

#include "engine/format/view.h"
#include "engine/src/base/state_spans.h"

namespace dcloth::engine {

// Three floats for each of a patch's points, component by component: [3][R].
constexpr size_t kAxes = 3;

// NaN becomes the lower limit: no pose puts one into the recurrent state.
inline float Clamp(float low, float high, float v) {
  const float above = v > low ? v : low;
  return above < high ? above : high;
}
inline float BoundPlace(float place) { return Clamp(-kLargestSaved, kLargestSaved, place); }

// A tick as all patches see it. Metres from its hips, world axes.
struct PatchPose {
  float* matrices;  // [joint_count, 12], G_j B_j^-1
  float* share;     // 1 / e; 0 where the cloth is carried along
  float* wind;      // [3], metres a tick
};

// Where a patch's points are in its frame.
struct PatchFrame {
  float* axes;    // [3, 3]: out, up, along
  float* centre;  // [3]
  float* base;    // [3][R]
};
constexpr size_t PatchFrameFloats(size_t points) { return 12 + kAxes * points; }
inline PatchFrame PatchFrameAt(float* floats) { return {floats, floats + 9, floats + 12}; }

// What a patch remembers of the ticks before, metres from this tick's hips.
struct PatchHistory {
  const float* displacement;   // u [3][R]
  float* last;                 // x_1 [3][R]; moved to where it was a tick ago
  const float* before;         // x_2 [3][R]
  float* last_centre;          // c_1; moved as x_1
  const float* before_centre;  // c_2
};

// A limb's capsule in this tick, and how far it has come in a tick.
struct CapsuleMotion {
  float start[3], way[3];                // axis, from the first end to the second
  float start_motion[3], way_motion[3];  // of the first end; of the second less that
  float end[3], end_motion[3];
  float inverse_squared;  // 1 / length^2 of the axis
  float radius, radius_change;
};

// [capsule_count] both ends of each, [6].
void PlaceCapsules(const format::PatchStageView& stage, const PatchPose& pose, float* ends);

// `ends_before`: those of the tick before.
void MoveCapsules(const format::PatchStageView& stage, const PatchPose& pose, const float* ends_before,
                  CapsuleMotion (&capsules)[format::kMaxCapsules]);

// Fills `frame` and the inputs x [19 R + 33 + E] of patch `k`. All but the embedding is
// finite and within +-8, whatever the pose.
void ReadPatch(const format::PatchStageView& stage, const PatchPose& pose,
               const CapsuleMotion (&capsules)[format::kMaxCapsules], size_t k, const PatchHistory& history,
               const PatchFrame& frame, float* x);

// x = b + Q u of a patch's points, [3][R].
void PlacePoints(const PatchFrame& frame, const float* displacement, size_t points, float* places);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_PATCH_INPUTS_H_
