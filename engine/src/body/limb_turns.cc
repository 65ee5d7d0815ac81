#include "engine/src/body/limb_turns.h"

#include <cmath>

namespace dcloth::engine {
namespace {

Turn TurnBack(const float* above, const LimbCore& core) {
  const float bone[3] = {core.to[0] - core.from[0], core.to[1] - core.from[1], core.to[2] - core.from[2]};
  float rest[3];
  for (size_t r = 0; r < 3; ++r) rest[r] = Dot(above + 4 * r, bone);
  Turn turn = {};
  Cross(core.along, rest, turn.axis);
  const float sine = std::sqrt(Dot(turn.axis, turn.axis)), cosine = Dot(core.along, rest);
  const float length = std::sqrt(sine * sine + cosine * cosine), share = length > 0 ? cosine / length : 1.0f;
  turn.cosine = std::sqrt(0.5f * (share > -1 ? 1 + share : 0.0f));
  turn.sine = std::sqrt(0.5f * (share < 1 ? 1 - share : 0.0f));
  for (float& c : turn.axis) c = sine > 0 ? c / sine : 0.0f;
  return turn;
}

void RotateCore(const Turn& turn, float share, const float* centre, LimbCore* core) {
  const Angle angle = AngleOf(turn, share);
  RotateAbout(turn.axis, angle, centre, core->posed_from);
  Rotate(turn.axis, angle, core->along);
  for (float(&around)[3] : core->posed_around) Rotate(turn.axis, angle, around);
}

}  // namespace

Angle AngleOf(const Turn& turn, float share) {
  const float w = 1 - std::fabs(share) * (1 - turn.cosine), x = share * turn.sine, inverse = 1 / (w * w + x * x);
  return {(w * w - x * x) * inverse, 2 * w * x * inverse};
}

void Rotate(const float* axis, Angle angle, float* vector) {
  float across[3];
  Cross(axis, vector, across);
  const float along = Dot(axis, vector) * (1 - angle.cosine);
  for (size_t c = 0; c < 3; ++c) vector[c] = angle.cosine * vector[c] + angle.sine * across[c] + along * axis[c];
}

void RotateAbout(const float* axis, Angle angle, const float* centre, float* point) {
  float from[3] = {point[0] - centre[0], point[1] - centre[1], point[2] - centre[2]};
  Rotate(axis, angle, from);
  for (size_t c = 0; c < 3; ++c) point[c] = centre[c] + from[c];
}

bool FillLimb(const format::ModelView& model, const float* matrices, const LimbCores& limbs, uint32_t upper,
              uint8_t bit, Limb* limb) {
  *limb = {};
  limb->bit = bit;
  for (uint32_t k = upper; k != kMostCores && limb->count < kMostParts; k = limbs.cores[k].below) {
    if (!(limbs.cores[k].scale > 0)) return false;
    limb->parts[limb->count++] = &limbs.cores[k];
    limb->cores |= 1u << k;
  }
  const uint32_t joint = limb->parts[0]->joint, above = model.parents[joint];
  if (above == format::kNoParent) return false;
  limb->upper = TurnBack(matrices + size_t{12} * above, *limb->parts[0]);
  limb->lower = TurnBack(matrices + size_t{12} * joint, *limb->parts[1]);
  return true;
}

LimbPose PoseAt(const Limb& limb, float share) {
  LimbPose pose = {};
  for (size_t k = 0; k < limb.count; ++k) {
    pose.parts[k] = *limb.parts[k];
    if (k > 0) RotateCore(limb.lower, share, limb.parts[1]->posed_from, &pose.parts[k]);
    RotateCore(limb.upper, share, limb.parts[0]->posed_from, &pose.parts[k]);
  }
  return pose;
}

}  // namespace dcloth::engine
