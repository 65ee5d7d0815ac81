// A cloth laid onto a character that its model was not trained on (dcloth_fit.h).
#ifndef DCLOTH_ENGINE_SRC_FIT_H_
#define DCLOTH_ENGINE_SRC_FIT_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_fit.h"
#include "engine/format/diagnostic.h"
#include "engine/src/cloth.h"

namespace dcloth::engine {

// The work that a fit may take: looks into cells of the grid in which samples of the skin find the vertices beside
// them, and what costs as much. It grows with the skin's triangles, their size, and the vertices around them. A hundred
// thousand triangles of a person's skin take half of it, or less.
constexpr uint64_t kFitWork = uint64_t{1} << 30;

size_t FitStorageSize(const format::ModelView& model, const dcloth_character& character);

// `character` is whole and its counts are in range. Counts `work_left` down (kFitWork). Refused, it changes nothing.
bool FitCloth(const dcloth_character& character, void* storage, size_t storage_size, uint64_t* work_left, Cloth* cloth,
              dcloth_fit* report, format::Diagnostic* diagnostic);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_FIT_H_
