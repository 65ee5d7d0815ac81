// The patch stage's table.
#ifndef DCLOTH_ENGINE_FORMAT_VERIFY_PATCHES_H_
#define DCLOTH_ENGINE_FORMAT_VERIFY_PATCHES_H_

#include "engine/format/checker.h"
#include "engine/format/schema.h"
#include "engine/format/view.h"

namespace dcloth::format {

// `model` has its garment and character. Fills model->patch_stage as far as it gets.
bool VerifyPatchStage(const PatchStage& stage, Checker* check, ModelView* model);

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_VERIFY_PATCHES_H_
