// What a tick runs, and how far it has come.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_TICK_WORK_H_
#define DCLOTH_ENGINE_SRC_NETWORK_TICK_WORK_H_

#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/tick_parts.h"
#include "engine/src/network/linear.h"

namespace dcloth::engine {

using format::TickPart;

// Of a tick of `stages`, one of DCLOTH_STAGES_*.
inline bool RunsSkeleton(uint32_t stages) { return stages >= DCLOTH_STAGES_SKELETON; }
inline bool RunsMesh(uint32_t stages) { return stages == DCLOTH_STAGES_MESH; }

// How far the tick in work has come.
struct TickWork {
  TickPart part;
  uint32_t items_done;       // of `part`
  InputScales input_scales;  // of the product in work
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_TICK_WORK_H_
