// A cloth laid onto a character that its model was not trained on (dcloth_fit.h).
#ifndef DCLOTH_ENGINE_SRC_FIT_H_
#define DCLOTH_ENGINE_SRC_FIT_H_

#include <cstddef>

#include "dcloth/dcloth_fit.h"
#include "engine/format/diagnostic.h"
#include "engine/src/cloth.h"

namespace dcloth::engine {

size_t FitStorageSize(const format::ModelView& model, const dcloth_character& character);

// `character` is whole and its counts are in range. Refused, it changes nothing.
bool FitCloth(const dcloth_character& character, void* storage, size_t storage_size, Cloth* cloth, dcloth_fit* report,
              format::Diagnostic* diagnostic);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_FIT_H_
