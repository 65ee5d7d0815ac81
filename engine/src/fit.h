// A cloth wears what the fit library has made for another character (engine/format/fit_file.h).
#ifndef DCLOTH_ENGINE_SRC_FIT_H_
#define DCLOTH_ENGINE_SRC_FIT_H_

#include <cstddef>

#include "engine/format/diagnostic.h"
#include "engine/src/cloth.h"

namespace dcloth::engine {

// The bytes come from files: hostile. Refused, they change nothing.
bool WearFit(const void* bytes, size_t size, Cloth* cloth, format::Diagnostic* diagnostic);

// Writes the host's index of every joint that moves the garment, found among `names` by the names in the model or in
// the fit that the cloth wears. Refused, it changes nothing.
bool BindJoints(const char* const* names, uint32_t count, Cloth* cloth, format::Diagnostic* diagnostic);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_FIT_H_
