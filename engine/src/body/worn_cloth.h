// Where a limb would wear its cloth: as the garment hangs from the joint above in the bind pose, bent around the limb
// as it is posed (NETWORK.md, "Limbs through cloth"). The limb is inside of it, as in the bind pose; where it bends
// sharply, a wide garment folds into itself on the inner side.
#ifndef DCLOTH_ENGINE_SRC_BODY_WORN_CLOTH_H_
#define DCLOTH_ENGINE_SRC_BODY_WORN_CLOTH_H_

#include <cstddef>
#include <cstdint>

#include "engine/src/body/limb_turns.h"

namespace dcloth::engine {

class WornCloth {
 public:
  // All are of this frame, and outlive this.
  WornCloth(const format::ModelView& model, const float* matrices, const LimbCores& limbs, const Limb& limb);
  WornCloth(const WornCloth&) = delete;
  WornCloth& operator=(const WornCloth&) = delete;

  // Of garment vertex `v`, in the host's space. Returns what share of it goes with the limb, the rest with the joint
  // above or other limbs. Cost: 0.15 us.
  float Place(size_t v, float* out) const;

 private:
  // A bone in the bind pose.
  struct Bone {
    const float* from;
    float along[3], inverse_squared;
  };

  static Bone BoneOf(const LimbCore& core);
  float ShareOf(const float* bound) const;

  const format::ModelView& model_;
  const Limb& limb_;
  const float* above_;  // matrix of the joint above the limb
  Bone bones_[kMostCores];
  size_t own_ = 0, count_ = 0;  // bones of this limb come first, then those of others
  float knee_[3];               // before the upper turn
  float knee_axis_[3];
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_WORN_CLOTH_H_
