// One tick of the network as work that can be put down after any portion and taken up in a later frame.
//
// A tick runs the parts of engine/format/tick_parts.h in their order; a part (a matrix product, a pass over the mesh)
// is a number of items (panels of 32 columns, blocks of 16 vertices). However a tick is cut, its result is the same to
// the bit: items never share a sum. The .cc file has a row for each part: its items and their cost, how to run some of
// them, and what a saved state keeps of it. A new part is a line in that list and a row here.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_SCHEDULE_H_
#define DCLOTH_ENGINE_SRC_NETWORK_SCHEDULE_H_

#include <cstdint>

#include "engine/src/base/state_spans.h"
#include "engine/src/base/stopwatch.h"
#include "engine/src/cloth.h"

namespace dcloth::engine {

// Estimated time of a tick in picoseconds on one core, from the sizes alone: it weighs parts against each
// other, so that equal portions take about equal time. The constants and their source are in the .cc file.
uint64_t TickCost(const format::ModelView& model, uint32_t stages);

// Takes the pose in: features, woken stages, body matrices. The caller has finished the tick before.
// `elapsed_ticks` is the time since that one, 1 unless ticks were skipped or waited.
void BeginTick(Cloth* cloth, const SkinPose& skin, uint32_t stages, double elapsed_ticks, Stopwatch* watch);

// Runs portions until their cost reaches `budget` or the tick is complete; returns what it ran, less than one
// item above the budget. A complete tick becomes the newest one. Without a tick in work it does nothing.
uint64_t ContinueTick(Cloth* cloth, uint64_t budget, Stopwatch* watch);

// Items of a part of a tick; none where the part does not take place.
uint64_t TickItems(const format::ModelView& model, uint32_t stages, TickPart part);

// Takes up a tick whose results so far lie in the cloth's memory: `items_done` of `part`, fewer than it has.
void ResumeTick(Cloth* cloth, TickPart part, uint32_t items_done);

// Adds the floats that a tick with this plan needs when it goes on from `at`, which is one that it can have.
void ListTickSpans(const Cloth& cloth, uint32_t stages, const TickWork& at, StateSpans* spans);

inline bool TickInWork(const Cloth& cloth) { return cloth.work.part != TickPart::kDone; }

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_SCHEDULE_H_
