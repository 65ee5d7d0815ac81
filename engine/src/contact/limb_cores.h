// The inside of a body's limbs: a bone with the space around it that is free of skin, as radii along and around it.
//
// A core tells on which side of a limb cloth is and moves it out, without a search: a place seen from the bone is
// inside where it is nearer to the bone than the radius there. The trunk has no core. Rejected: the closest skin, which
// lies inside of the body itself where a bent knee presses the calf into the thigh.
#ifndef DCLOTH_ENGINE_SRC_CONTACT_LIMB_CORES_H_
#define DCLOTH_ENGINE_SRC_CONTACT_LIMB_CORES_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/view.h"
#include "engine/src/base/lent_memory.h"
#include "engine/src/base/vec.h"

namespace dcloth::engine {

constexpr uint32_t kMostCores = 24;
constexpr int kCoreSlices = 8;        // along the bone
constexpr int kCoreSectors = 16;      // around it
constexpr float kCoreOfSkin = 0.96f;  // of the skin's distance: skin that bends stays outside

// Where a bone is. In its frame z runs along the bone from its start. Metres from the hips outside.
struct BoneFrame {
  Vecf axes[3];  // unit, over the scale that the pose gives the bone
  Vecf start;

  Vecf Into(Vecf p) const {
    const Vecf d = p - start;
    return {Dot(axes[0], d), Dot(axes[1], d), Dot(axes[2], d)};
  }
};
constexpr float kLargestBone = 1e9f;  // of what is kept of a bone between frames
constexpr size_t kBoneFloats = sizeof(BoneFrame) / sizeof(float);

struct LimbCore {
  Vecf start, axes[3];  // of the bone in the bind pose: two axes across it, then its own
  float length;         // metres, as all that follows
  float radii[kCoreSlices][kCoreSectors];
  float start_radius, end_radius;  // of the balls around its ends
  float widest;
  bool bends_at_start, bends_at_end;  // with another core: there the ball is as wide as the limb
  uint8_t touched_by;                 // classes of the garment that may touch it; all where there are none
  uint8_t limb;                       // cores that hang together are one limb
  uint16_t joint;
  BoneFrame now, before;  // in this frame and in the last one
  Vecf out[3];            // what a metre along each axis of `now` is outside
};

struct LimbCores {
  LimbCore* cores;  // [kMostCores]
  uint32_t* count;  // [1]
};

LimbCores PlaceLimbCores(Arena* arena);

// Measures the cores of the model's body in the bind pose: none where the file has no parents of joints. Once for each
// body. Cost: 0.5 ms for 8,000 vertices of skin.
void MeasureLimbCores(const format::ModelView& model, const LimbCores& limbs);

// Poses `now` by a joint's skinning matrix [12].
void PoseBone(const float* matrix, LimbCore* core);

// Out of the frame of `now`.
inline Vecf OutOf(const LimbCore& core, Vecf p) {
  return core.now.start + p.x * core.out[0] + p.y * core.out[1] + p.z * core.out[2];
}

// How thick the limb is where `p`, in the bone's frame, is nearest to it.
float RadiusAt(const LimbCore& core, Vecf p);

// The point of the bone that is nearest to p, both in its frame.
inline float NearestOnBone(const LimbCore& core, Vecf p) {
  return p.z < 0 ? 0.0f : p.z > core.length ? core.length : p.z;
}

// Moves `p`, in the bone's frame, straight away from the bone out of the core. Returns how deep it was, 0 where it was
// outside; `normal` is the way it went.
float LeaveCore(const LimbCore& core, Vecf* p, Vecf* normal);

// Moves a point from `from`, outside, to `*to`, both in the bone's frame: out of the core after each part of the way,
// with friction. True where the core was met.
bool Slide(const LimbCore& core, Vecf from, Vecf* to);

// Whether the straight way from a to b, in the bone's frame, leads through the core.
bool LeadsThrough(const LimbCore& core, Vecf a, Vecf b);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CONTACT_LIMB_CORES_H_
