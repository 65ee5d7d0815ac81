// A graph layer's products in integers (kernels/gsgru/gsgru_i8.h).
#ifndef DCLOTH_CONVERTER_INTEGER_LAYER_H_
#define DCLOTH_CONVERTER_INTEGER_LAYER_H_

#include "converter/bundle.h"
#include "converter/fold.h"

namespace dcloth::converter {

struct IntegerLayer {
  Matrix weights;  // [F, 7 F], of the first layer [F, 4 F]: to be multiplied by integers, so steps are in it
  Vector input_inverse_steps;  // [F]; empty for the first layer
};

// `output` is W^o; `before` the layer whose next x are this one's inputs, null for the first. Inputs get steps from
// what its layer norm can give: a feature is at most sqrt(F - 1) deviations from the mean, and beyond four it is cut
// off, which a mean over neighbours hardly ever reaches. h, r h and h' never leave +-1.
IntegerLayer StackIntegerLayer(const FoldedMeshLayer& layer, const Matrix& output, const MeshLayerWeights* before);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_INTEGER_LAYER_H_
