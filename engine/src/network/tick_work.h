// What a tick runs, and how far it has come.
#ifndef DCLOTH_ENGINE_SRC_NETWORK_TICK_WORK_H_
#define DCLOTH_ENGINE_SRC_NETWORK_TICK_WORK_H_

#include <cstdint>

#include "dcloth/dcloth.h"
#include "engine/format/tick_parts.h"
#include "engine/src/network/linear.h"

namespace dcloth::engine {

using format::TickPart;

// What a tick of `stages`, one of DCLOTH_STAGES_*, runs of the stages that the model has.
inline bool RunsSkeleton(const format::ModelView& model, uint32_t stages) {
  return stages >= DCLOTH_STAGES_SKELETON && model.skeleton_stage.units != 0;
}
inline bool RunsMesh(const format::ModelView& model, uint32_t stages) {
  return stages == DCLOTH_STAGES_MESH && model.mesh_stage.layer_count != 0;
}
inline bool RunsPatches(const format::ModelView& model, uint32_t stages) {
  return stages >= DCLOTH_STAGES_SKELETON && model.patch_stage.patch_count != 0;
}

// How far the tick in work has come.
struct TickWork {
  TickPart part;
  uint32_t items_done;       // of `part`
  InputScales input_scales;  // of the product in work
};

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_NETWORK_TICK_WORK_H_
