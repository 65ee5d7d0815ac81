// Bundle -> the parts of a model file at one precision.
#ifndef DCLOTH_CONVERTER_ASSEMBLE_H_
#define DCLOTH_CONVERTER_ASSEMBLE_H_

#include <optional>
#include <string>

#include "converter/body_surface.h"
#include "converter/bundle.h"
#include "converter/fold.h"
#include "converter/precision.h"
#include "converter/prune.h"
#include "converter/reduce.h"
#include "converter/write_model.h"

namespace dcloth::converter {

// What does not depend on the precision.
struct FoldedBundle {
  MatrixD skin_weights;  // [n, m], folded
  PrunedWeights skin;    // columns index bundle.bones
  MatrixD body_weights;  // [n, J], empty without a mesh stage
  PrunedWeights body;    // columns index bundle.joint_names; empty without a mesh stage
  BodySurface surface;   // empty where no skin collides
  JointSubset joints;
  std::optional<ReducedBasis> reduced;  // stored in place of the stacked basis
};
FoldedBundle FoldBundle(const Bundle& bundle, uint32_t influences, uint32_t body_influences);

// Which precision each matrix gets. `only` names the one matrix that is quantised while all others stay f32
// ("displacement.basis.weights"); empty quantises all.
struct PrecisionPlan {
  Precision precision = Precision::kFp32;
  std::string only;
};

// The precision applies to the bases, the GRU and the vertex MLP: over 98 % of a model of the paper's size.
// The static MLP (0.4 %) is never below fp16: its output moves pivots, which moves every vertex, and int8
// would save 0.1 MB. All else (geometry, gates, mesh layers, embedding, biases) stays f32. Throws Error where
// fp16 overflows.
ModelParts Assemble(const Bundle& bundle, const FoldedBundle& folded, const PrecisionPlan& plan);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_ASSEMBLE_H_
