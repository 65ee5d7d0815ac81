// Sleeves that the network drew beside their arm, or through it, are drawn onto it; before LayOverLimbs lays cloth over
// limbs (NETWORK.md, "Sleeves").
//
// A sleeve goes around a limb on all sides: an arm, in trousers a leg. It is cut into rings across the limb. One that
// the bones no longer go through has lost the limb. No vertex can tell that: much of such a ring lies well outside of
// the skin.
#ifndef DCLOTH_ENGINE_SRC_BODY_SLEEVES_H_
#define DCLOTH_ENGINE_SRC_BODY_SLEEVES_H_

#include <cstdint>

#include "engine/src/base/lent_memory.h"
#include "engine/src/body/limb_cores.h"
#include "engine/src/draw/output.h"

namespace dcloth::engine {

constexpr uint8_t kNoSleeve = 0xFF;

struct Sleeves {
  uint8_t* cores;  // [n] core of the limb that a garment vertex goes around, or kNoSleeve
};

// The model has a body.
Sleeves PlaceSleeves(const format::ModelView& model, Arena* arena);

// Once for each body, after MeasureLimbCores. Fills in `in_sleeve` of the cores. Cost: 1 ms for 10,000 vertices.
void FindSleeves(const format::ModelView& model, const LimbCores& limbs, const Sleeves& sleeves);

// Shifts rings that have lost their limb, or nearly, across it until it goes through them; those that do not hold it
// even so are laid close around it. Where along it and how turned, the rings before and after them tell that hold it;
// in the crook of an elbow cloth is pressed out between the limbs. `limbs` are posed. Cost for two sleeves of 650
// vertices: 0.15 ms.
void ThreadSleeves(const format::ModelView& model, const LimbCores& limbs, const Sleeves& sleeves,
                   const Surface& surface);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_BODY_SLEEVES_H_
