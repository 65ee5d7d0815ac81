// Bundle -> the parts of a model file at one precision.
#ifndef DCLOTH_CONVERTER_ASSEMBLE_H_
#define DCLOTH_CONVERTER_ASSEMBLE_H_

#include <map>
#include <optional>
#include <string>

#include "converter/body_surface.h"
#include "converter/bundle.h"
#include "converter/coarse_mesh.h"
#include "converter/fold.h"
#include "converter/precision.h"
#include "converter/prune.h"
#include "converter/reduce.h"
#include "converter/texture_mesh.h"
#include "converter/write_model.h"

namespace dcloth::converter {

// What does not depend on the precision.
struct FoldedBundle {
  MatrixD skin_weights;  // [n, m], folded
  PrunedWeights skin;    // columns index bundle.bones
  MatrixD body_weights;  // [n, J], empty without a mesh stage
  PrunedWeights body;    // columns index bundle.joint_names; empty without a mesh stage
  BodySurface surface;   // empty where no skin collides
  CoarseMesh coarse;     // empty where no vertex could be left out
  TextureMesh texture;   // empty where the bundle says no places in a texture
  JointSubset joints;
  std::optional<ReducedBasis> reduced;  // stored in place of the stacked basis
};
FoldedBundle FoldBundle(const Bundle& bundle, uint32_t influences, uint32_t body_influences);

// Which precision each matrix gets.
struct PrecisionPlan {
  Precision precision = Precision::kFp32;
  // The one matrix that is quantised while all others stay f32 ("displacement.basis.weights"); empty quantises all.
  std::string only;
  // Matrices that get another precision than that; a model with any is "mixed".
  std::map<std::string, Precision> formats = {};

  const char* name() const { return formats.empty() ? PrecisionName(precision) : "mixed"; }
};

// Whether `matrix` is a graph layer's: one format for all its products, int8 or f32.
bool IsLayer(const std::string& matrix);

// What `matrix` ("displacement.basis", without ".weights") is stored in.
Precision FormatOf(const PrecisionPlan& plan, const std::string& matrix);

// The precision applies to the bases, the GRU, the vertex MLP, the patch stage and, as int8 from 16 features on, to the
// graph layers.
// The static MLP (0.4 %) is never below fp16: its output moves pivots, which moves every vertex, and int8
// would save 0.1 MB; nor is the head of a reduced basis (reduce.h). All else (geometry, gates, embedding, biases)
// stays f32. Throws Error where fp16 overflows.
ModelParts Assemble(const Bundle& bundle, const FoldedBundle& folded, const PrecisionPlan& plan);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_ASSEMBLE_H_
