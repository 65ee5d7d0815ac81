// A garment laid onto a character that its model was not trained on (dcloth_fit.h), as the bytes of a .dcloth-fit.
#ifndef DCLOTH_FIT_MAKE_FIT_H_
#define DCLOTH_FIT_MAKE_FIT_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_fit.h"
#include "engine/format/diagnostic.h"
#include "engine/format/view.h"
#include "engine/src/pose/space.h"

namespace dcloth::fit {

// The work that a fit may take: looks into cells of the grid in which samples of the skin find the vertices beside
// them, and what costs as much. It grows with the skin's triangles, their size, and the vertices around them. A hundred
// thousand triangles of a person's skin take two thirds of it, or less.
constexpr uint64_t kFitWork = 420'000'000;

size_t FitStorageSize(const format::ModelView& model, const dcloth_character& character);

// Writes the fit, report->file_bytes long, where `storage` begins. `character` is whole and its counts are in range.
// Counts `work_left` down (kFitWork). Refused, it leaves the fit that may lie there.
bool MakeFit(const format::ModelView& model, const engine::Space& space, const dcloth_character& character,
             void* storage, size_t storage_size, uint64_t* work_left, dcloth_fit* report,
             format::Diagnostic* diagnostic);

}  // namespace dcloth::fit

#endif  // DCLOTH_FIT_MAKE_FIT_H_
