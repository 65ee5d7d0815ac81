// What a tick runs, and how far it has come.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_TICK_PLAN_H_
#define DCLOTH_ENGINE_SRC_NETWORK_TICK_PLAN_H_

#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/tick_parts.h"
#include "engine/src/network/linear.h"

namespace dcloth::engine {

using format::TickPart;

// What the mesh stage does in a tick of DCLOTH_STAGES_MESH.
enum class MeshPace : uint32_t {
  kRun,         // runs, its coefficients count at once
  kRunFirst,    // the same, and they are kept: half rate begins
  kRunBetween,  // runs after a tick of rest: half way from the coefficients kept to its own
  kRest         // does not run: the rest of that way
};

struct TickPlan {
  uint32_t stages;  // one of DCLOTH_STAGES_*
  MeshPace mesh = MeshPace::kRun;
};

inline bool RunsSkeleton(const TickPlan& plan) { return plan.stages >= DCLOTH_STAGES_SKELETON; }
inline bool HasMesh(const TickPlan& plan) { return plan.stages == DCLOTH_STAGES_MESH; }  // in its displacement
inline bool AtHalfRate(const TickPlan& plan) { return HasMesh(plan) && plan.mesh != MeshPace::kRun; }
inline bool RunsMesh(const TickPlan& plan) { return HasMesh(plan) && plan.mesh != MeshPace::kRest; }

// How far the tick in work has come.
struct TickWork {
  TickPart part;
  uint32_t items_done;       // of `part`
  InputScales input_scales;  // of the product in work
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_TICK_PLAN_H_
