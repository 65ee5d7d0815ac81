// Which of the host's joints is which of the model's, by name.
#ifndef DCLOTH_ENGINE_SRC_JOINT_BINDING_H_
#define DCLOTH_ENGINE_SRC_JOINT_BINDING_H_

#include <cstdint>

#include "engine/format/diagnostic.h"
#include "engine/format/view.h"

namespace dcloth::engine {

// Writes the host's index of every joint of the model into `joint_map`, [joint_count]; of equal names the
// first. False where some are missing: the text names them, and `joint_map` is untouched.
bool MatchJoints(const format::ModelView& model, const char* const* names, uint32_t count, uint32_t* joint_map,
                 format::Diagnostic* diagnostic);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_JOINT_BINDING_H_
