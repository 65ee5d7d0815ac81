// A cloth's recurrent state as bytes that outlive the process: little-endian, the same on every platform and
// instruction set. Saved states come from save games, so each number is checked before the first one is used.
//
//   StateHead, then poses f64 [0 to 3][joint_count, 12], then the floats of ListStateSpans, then
//   KeptPlaces; nothing between them.
#ifndef DCLOTH_ENGINE_SRC_STATE_STATE_H_
#define DCLOTH_ENGINE_SRC_STATE_STATE_H_

#include <cstddef>
#include <cstdint>

#include "engine/format/diagnostic.h"
#include "engine/src/base/state_spans.h"
#include "engine/src/cloth.h"

namespace dcloth::engine {

constexpr uint8_t kStateMagic[4] = {'D', 'C', 'L', 'S'};
constexpr uint32_t kStateVersion = 5;

struct StateHead {
  uint8_t magic[4];
  uint32_t version;
  uint64_t checksum;  // format::Checksum of all that follows
  uint64_t size;      // of the whole, this head included
  uint64_t identity;  // of the model
  // The model's numbers that decide what follows.
  uint32_t joint_count, feature_count, bone_count, vertex_count, skeleton_units, layer_count, feature_width;
  float tick_rate;
  // Where in time; see Cloth, TickWork and FrameClock. `part` is a number of engine/format/tick_parts.h.
  uint32_t tick_count, stages, part, items_done, jumped, contact, idle_ticks;  // `contact`: see ContactOf
  float tick_share;
  double since, waited, lag, older_step;
  double heading[2], position[3], velocity[3], yaw_rate, velocity_age, wind[3];
  uint64_t idle_floats;  // of Cloth::idle_start; 0 where none of the next ticks looks at it
  float contact_seconds;
  uint32_t patch_shape;  // PatchShape
};

constexpr size_t kStateSummedFrom = offsetof(StateHead, size);

// Where in time a state was saved, of which follows how many floats it has.
struct StatePosition {
  uint32_t tick_count;  // 0 to kTickSlots; with 0 there are no floats
  uint32_t stages;      // one of DCLOTH_STAGES_*
  TickWork work;
  uint64_t idle_floats;  // of Cloth::idle_start, of this model or another one
  uint32_t contact;
};

// 0 where no frame was kept outside the body; else one more than the limb cores, whose bones are among the floats.
// KeptPlaces then follow the floats.
uint32_t ContactOf(const Cloth& cloth);

// The head's `part` has been checked.
StatePosition PositionOf(const StateHead& head);

// What the continuation of a cloth depends on, and nothing else. `position` is one that a tick of the model can have.
//
// Not among the floats: what a tick makes before it reads, integers of int8 products (made anew from their input),
// padding. Rejected: to finish a tick in work before saving, which draws other frames than the cloth that goes on, and
// to begin it anew, for which its start is gone.
void ListStateSpans(const Cloth& cloth, const StatePosition& position, StateSpans* spans);

// Of the file where its writer told one, of its name before format 1.2.
uint64_t ModelIdentity(const format::ModelView& model);

// Of the pose of the last update, the idle pose, and the pose before the last where that one bends the motion.
size_t StatePoseBytes(const StateHead& head);

size_t StateSize(const Cloth& cloth);

// The verdict is the diagnostic's status, as dcloth.h returns it.
// Writes StateSize bytes, or none where the cloth holds numbers that RestoreState refuses, which only weights that are
// broken make.
void SaveState(const Cloth& cloth, void* bytes, format::Diagnostic* diagnostic);

// The cloth goes on to the bit as the one that was saved. Refused, and the cloth unchanged, where the bytes are
// damaged, of another version or model, or hold what no cloth can have. `other_model` also takes those of a model with
// the same numbers and another identity, between ticks.
void RestoreState(const void* bytes, size_t size, bool other_model, Cloth* cloth, format::Diagnostic* diagnostic);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_STATE_STATE_H_
