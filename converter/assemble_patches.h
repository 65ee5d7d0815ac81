// The patch stage of a bundle -> that of a model file.
#ifndef DCLOTH_CONVERTER_ASSEMBLE_PATCHES_H_
#define DCLOTH_CONVERTER_ASSEMBLE_PATCHES_H_

#include "converter/assemble.h"

namespace dcloth::converter {

// int8 layers have a scale for each column and none for rows: their inputs are rounded once for all patches. Throws
// Error where fp16 overflows.
PatchStageParts AssemblePatches(const PatchWeights& patches, const JointSubset& joints, const PrecisionPlan& plan);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_ASSEMBLE_PATCHES_H_
