// Which parts of the network a tick runs.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_TICK_PLAN_H_
#define DCLOTH_ENGINE_SRC_NETWORK_TICK_PLAN_H_

#include <cstdint>

#include "dcloth/dcloth.h"

namespace dcloth::engine {

// What the mesh stage does in a tick of DCLOTH_STAGES_MESH.
enum class MeshTurn : uint32_t {
  kRun,         // runs, its coefficients count at once
  kRunFirst,    // the same, and they are kept: half rate begins
  kRunBetween,  // runs after a tick of rest: half way from the coefficients kept to its own
  kRest         // does not run: the rest of that way
};

struct TickPlan {
  uint32_t stages;  // one of DCLOTH_STAGES_*
  MeshTurn mesh = MeshTurn::kRun;
};

inline bool RunsSkeleton(const TickPlan& plan) { return plan.stages >= DCLOTH_STAGES_SKELETON; }
inline bool HasMesh(const TickPlan& plan) { return plan.stages == DCLOTH_STAGES_MESH; }  // in its displacement
inline bool AtHalfRate(const TickPlan& plan) { return HasMesh(plan) && plan.mesh != MeshTurn::kRun; }
inline bool RunsMesh(const TickPlan& plan) { return HasMesh(plan) && plan.mesh != MeshTurn::kRest; }

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_TICK_PLAN_H_
