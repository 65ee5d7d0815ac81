// The patch stage of a bundle.
#ifndef DCLOTH_CONVERTER_BUNDLE_PATCHES_H_
#define DCLOTH_CONVERTER_BUNDLE_PATCHES_H_

#include "converter/bundle.h"
#include "converter/tensor_reader.h"

namespace dcloth::converter {

// The group patch.* for a garment of `vertices` and a character of `joints`. Throws Error as ReadBundle does.
PatchWeights ReadPatches(TensorReader* reader, uint64_t vertices, uint64_t joints);

}  // namespace dcloth::converter

#endif  // DCLOTH_CONVERTER_BUNDLE_PATCHES_H_
