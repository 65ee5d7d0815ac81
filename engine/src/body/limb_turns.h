// A limb's pose as two turns away from how its joints hold it in the bind pose: one at the hip, one at the knee.
#ifndef DCLOTH_ENGINE_SRC_BODY_LIMB_TURNS_H_
#define DCLOTH_ENGINE_SRC_BODY_LIMB_TURNS_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/body/limb_cores.h"

namespace dcloth::engine {

// The smallest that takes a posed bone to where the joint above it holds it in the bind pose.
struct Turn {
  float axis[3];       // unit vector, or zero
  float cosine, sine;  // of half the angle
};

struct Angle {
  float cosine, sine;
};

// Of a share of a turn, or of the opposite one where it is negative: between quaternions, straight.
Angle AngleOf(const Turn& turn, float share);

// About an axis through the origin, or through `centre`.
void Rotate(const float* axis, Angle angle, float* vector);
void RotateAbout(const float* axis, Angle angle, const float* centre, float* point);

constexpr size_t kMostParts = 3;  // of a limb: thigh, shank, foot

// Of this frame.
struct Limb {
  const LimbCore* parts[kMostParts];
  size_t count;  // 2 at least
  Turn upper, lower;
  uint8_t bit;     // of VisitLimbs
  uint32_t cores;  // a bit each
};

// The limb of the core `upper`; `matrices` [joint_count, 12] take the bind pose to the host's space. False where it
// cannot be turned.
bool FillLimb(const format::ModelView& model, const float* matrices, const LimbCores& limbs, uint32_t upper,
              uint8_t bit, Limb* limb);

struct LimbPose {
  LimbCore parts[kMostParts];
};

// Turned back by a share of both turns.
LimbPose PoseAt(const Limb& limb, float share);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_LIMB_TURNS_H_
