// The last content rung: the body's colliding surface against the character's joints.
#ifndef DCLOTH_ENGINE_FORMAT_VERIFY_BODY_H_
#define DCLOTH_ENGINE_FORMAT_VERIFY_BODY_H_

#include "engine/format/checker.h"

namespace dcloth::format {

// Joints of `view` are verified.
bool VerifyBody(const Body& body, Checker* check, ModelView* view);

}  // namespace dcloth::format

#endif  // DCLOTH_ENGINE_FORMAT_VERIFY_BODY_H_
