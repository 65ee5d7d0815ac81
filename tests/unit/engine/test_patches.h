// A patch stage for test models.
#ifndef DCLOTH_TESTS_UNIT_ENGINE_TEST_PATCHES_H_
#define DCLOTH_TESTS_UNIT_ENGINE_TEST_PATCHES_H_

#include "tests/unit/engine/model_builder.h"
#include "tests/unit/engine/tensor_writer.h"

namespace dcloth::testing {

// Cuts the tube into strips of segments and these into pieces of rings. `numbers` has all but the patches.
std::unique_ptr<format::PatchStageT> PatchStage(const ModelSpec& spec, TensorWriter* writer, Numbers* numbers);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_UNIT_ENGINE_TEST_PATCHES_H_
