// What a saved state has to be before a cloth takes it, rung by rung. The bytes come from save games: hostile.
#ifndef DCLOTH_ENGINE_SRC_STATE_STATE_CHECK_H_
#define DCLOTH_ENGINE_SRC_STATE_STATE_CHECK_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/diagnostic.h"
#include "engine/src/state/state.h"

namespace dcloth::engine {

// Size, start, version, checksum: all that can be told without a model. Fills *head.
bool CheckStateBytes(const uint8_t* bytes, size_t size, StateHead* head, format::Diagnostic* diagnostic);

// The model is the one that the state was saved with or, with `other_model`, one with the same numbers.
bool CheckStateModel(const StateHead& head, const format::ModelView& model, bool other_model,
                     format::Diagnostic* diagnostic);

// Everything in the head is something that a cloth of the model can have. Afterwards the head's position may be used.
bool CheckStateHead(const StateHead& head, const format::ModelView& model, format::Diagnostic* diagnostic);

bool CheckStatePoses(const uint8_t* bytes, const StateHead& head, format::Diagnostic* diagnostic);

// The floats, which begin at `offset`; in the cloth's memory where `bytes` is null.
bool CheckStateSpans(const uint8_t* bytes, size_t offset, const StateSpans& spans, format::Diagnostic* diagnostic);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_STATE_STATE_CHECK_H_
