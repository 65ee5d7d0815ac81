// The steps of contact, in their order (NETWORK.md, "Contact"). `places` hold targets and `offsets` what is carried
// along, until the last step, where `places` hold where vertices are.
#ifndef DCLOTH_ENGINE_SRC_CONTACT_STEPS_H_
#define DCLOTH_ENGINE_SRC_CONTACT_STEPS_H_

#include "engine/format/view.h"
#include "engine/src/contact/contact.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

// Fills in `near` for each patch and `close` for each vertex; returns the limbs, bit by bit, whose bones go through the
// target.
uint32_t FindPiercedLimbs(const format::ModelView& model, const ContactMemory& memory);

// Moves each vertex from where it was, seen from a bone, to where it is carried, and out of the cores on that way.
// Where the limb goes through the target, cloth between the two sides is held by the limb. Where it does not, the
// target's side is right, and an offset through the limb is dropped. Fills in `holds`.
void KeepSides(const format::ModelView& model, const ContactMemory& memory, uint32_t pierced);

// Lists the vertices that may leave their targets: those that do or are moved, and rings around them that grow with the
// move, from the moved outward. Returns how many; no more than kMostActive, and the others go back to their targets.
size_t ListActive(const format::ModelView& model, const ContactMemory& memory);

// Sweeps over the listed vertices: each offset goes to the mean of its neighbours', edges that are too long shorten,
// and cloth slides around the cores.
void GiveWay(const format::ModelView& model, const ContactMemory& memory, size_t count);

// Moves every vertex that is under the skin, or less than the clearance over it, along the normal to that height; then
// both ends of long edges whose middle is under it (D-Cloth eq. 18). The posed skin is in place. Fills in `skin`.
void PushOutOfSkin(const kernels::KernelTable& kernels, const format::ModelView& model, const ContactMemory& memory);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_CONTACT_STEPS_H_
