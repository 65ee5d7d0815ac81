// What a garment's displacement does on motion, for a reduction that knows what it may drop.
#ifndef DCLOTH_CONVERTER_CALIBRATE_H_
#define DCLOTH_CONVERTER_CALIBRATE_H_

#include <span>

#include "converter/assemble.h"
#include "converter/reduce.h"
#include "converter/sequence.h"

namespace dcloth::converter {

// The second moment [r, r], square metres, of delta in the frame's coordinates over every frame of `motion`, half of it
// from the skeleton stage alone and half from all stages, so that each level of detail keeps what it needs. Measured
// through the engine: a float32 model whose vertices all hang on one bone shows delta itself, turned as the bone is.
// `folded` gives what else the model is made of. Throws Error.
// Cost: three runs of the motion; one sequence's positions are kept.
MatrixD DisplacementMoment(const Bundle& bundle, const FoldedBundle& folded, const BasisFrame& frame,
                           std::span<const Sequence> motion);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_CALIBRATE_H_
