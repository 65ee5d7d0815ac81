#include "engine/src/body/worn_cloth.h"

#include <cmath>

namespace dcloth::engine {
namespace {

// Nothing is bent at the hip, all from this share of the thigh on.
constexpr float kHip = 0.25f;
// Half is bent at the knee, nothing and all this share of the shank above and below.
constexpr float kKnee = 0.15f;
// Half goes with a limb where another is as near, all and nothing where that is so many metres further and nearer.
constexpr float kBetween = 0.08f;
constexpr float kFar = 1e18f;

float Smooth(float x) { return x > 0 ? (x < 1 ? x * x * (3 - 2 * x) : 1.0f) : 0.0f; }

}  // namespace

WornCloth::Bone WornCloth::BoneOf(const LimbCore& core) {
  Bone bone = {core.from, {core.to[0] - core.from[0], core.to[1] - core.from[1], core.to[2] - core.from[2]}, 0};
  bone.inverse_squared = 1 / Dot(bone.along, bone.along);
  return bone;
}

WornCloth::WornCloth(const format::ModelView& model, const float* matrices, const LimbCores& limbs, const Limb& limb)
    : model_(model), limb_(limb), above_(matrices + size_t{12} * model.parents[limb.parts[0]->joint]) {
  for (; own_ < limb.count; ++own_) bones_[own_] = BoneOf(*limb.parts[own_]);
  count_ = own_;
  VisitLimbs(limbs, [&](const LimbCore& upper, uint32_t k, uint8_t) {
    for (; &upper != limb.parts[0] && k != kMostCores; k = limbs.cores[k].below)
      bones_[count_++] = BoneOf(limbs.cores[k]);
  });
  Transform(above_, limb.parts[1]->from, knee_);
  for (size_t c = 0; c < 3; ++c) knee_axis_[c] = limb.lower.axis[c];
  Rotate(limb.upper.axis, AngleOf(limb.upper, 1), knee_axis_);
}

float WornCloth::Place(size_t v, float* out) const {
  const float* bound = model_.template_positions + 3 * v;
  const auto along = [&](const Bone& bone) {
    return PlaceOnBone(bone.from, bone.along, bone.inverse_squared, bound).along;
  };
  const float share = Smooth(along(bones_[0]) / kHip) * ShareOf(bound);
  const float bent = Smooth(0.5f + along(bones_[1]) / (2 * kKnee));
  Transform(above_, bound, out);
  RotateAbout(knee_axis_, AngleOf(limb_.lower, -bent), knee_, out);
  RotateAbout(limb_.upper.axis, AngleOf(limb_.upper, -share), limb_.parts[0]->posed_from, out);
  return share;
}

// How much of a vertex goes with this limb, beside others.
float WornCloth::ShareOf(const float* bound) const {
  float own = kFar, other = kFar;
  for (size_t k = 0; k < count_; ++k) {
    const Bone& bone = bones_[k];
    const float squared = PlaceOnBone(bone.from, bone.along, bone.inverse_squared, bound).squared;
    float& least = k < own_ ? own : other;
    least = squared < least ? squared : least;
  }
  return Smooth(0.5f + (std::sqrt(other) - std::sqrt(own)) / (2 * kBetween));
}

}  // namespace dcloth::engine
