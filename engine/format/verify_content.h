// The last rung of the ladder: the content of a structurally sound file, table by table.
#ifndef DCLOTH_ENGINE_FORMAT_VERIFY_CONTENT_H_
#define DCLOTH_ENGINE_FORMAT_VERIFY_CONTENT_H_

#include "engine/format/checker.h"
#include "engine/format/schema.h"
#include "engine/format/view.h"

namespace dcloth::format {

// Fills *view as far as it gets.
bool VerifyContent(const Model& model, Checker* checker, ModelView* view);

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_VERIFY_CONTENT_H_
