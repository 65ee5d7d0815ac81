// Many characters, one budget: which level each gets and in which frame it ticks. Arithmetic over a cost model that
// the host measured; the cloths are only read, and the host updates them itself, on whatever threads it likes.
//
// A plan has two steps: levels for the mean of many frames (ChooseLevels), then the ticks of this very frame
// (GrantTicks). What the second cannot afford waits: its grid moves, so that characters that all spawned in one
// frame spread over the frames of a tick by themselves. Rejected: spreading each tick over frames for all of them
// (half a tick more of delay, and each character's weights are fetched in every frame).
#ifndef DCLOTH_ENGINE_SRC_SCENE_SCENE_H_
#define DCLOTH_ENGINE_SRC_SCENE_SCENE_H_

#include <cstddef>
#include <cstdint>

#include "dcloth/dcloth_scene.h"
#include "engine/src/cloth.h"

namespace dcloth::engine {

// A character at DCLOTH_LEVEL_FROZEN gets a tick of the static stage this often.
constexpr double kRefreshSeconds = 1;

constexpr uint32_t kMostUndrawn = 15;
constexpr uint32_t kNoLevel = DCLOTH_LEVEL_SKELETON + 1;  // the mesh stage at half rate, until 0.2

struct SceneCharacter {
  const Cloth* cloth;  // null: an empty slot
  float importance;
  uint32_t top_level;                          // that the model and the host allow
  float draw_microseconds[DCLOTH_DRAW_COUNT];  // of a frame without a tick; 0 where it is not offered
  uint32_t most_undrawn;                       // frames in a row, up to kMostUndrawn
  float tick_microseconds[DCLOTH_LEVEL_COUNT];
  float error_mm[DCLOTH_LEVEL_COUNT];
  uint32_t level;          // of the last plan
  uint32_t ticks;          // of the last plan's frame: 0 to kMaxTicks
  bool held;               // no tick may start in the last plan's frame
  double microseconds;     // planned for that frame
  double stale_seconds;    // since a plan last gave it a tick
  double late_seconds;     // since its tick fell due
  uint32_t detail;         // of the last plan, see drawing.cc
  uint32_t draw;           // of the last plan's frame: DCLOTH_DRAW_*
  uint32_t drawn;          // the last one that was not DCLOTH_DRAW_NONE
  uint32_t waited_frames;  // since what its detail does not draw in every frame was drawn
  // Scratch of a plan.
  uint32_t held_level, held_detail;  // of the plan before
  double share;                      // of a frame, see ChooseLevels; microseconds in ChooseDetails
  uint32_t next;                     // the best raise
  double next_share, worth;
  struct Step {
    bool ticks, held;  // of a level, or of a detail; whether the last plan had it
    uint32_t next;
    double cost;                              // microseconds
  } step;                                     // the best one, see ChooseDetails
  uint32_t finest, likely_level, likely_top;  // allowed to ChooseDetails; the level that it counts with
};

struct Scene {
  uint32_t count;
  SceneCharacter* characters;   // [count]
  uint32_t* order;              // [count], scratch
  double frame_seconds;         // mean of late
  double load;                  // what frames really cost over what their plans said
  double reserve;               // share of the budget that is kept back, of late overruns
  double budget;                // of the last plan, microseconds
  double planned_microseconds;  // of the last plan, `load` included
  double alternates_left;       // microseconds of drawing that earlier frames left over
};

// With `storage` null it only returns the size.
size_t PlaceScene(uint32_t count, void* storage, Scene** scene);

// Starts a slot anew: frozen, never ticked.
void SetCharacter(const dcloth_scene_character& character, SceneCharacter* slot);

void PlanScene(Scene* scene, const dcloth_scene_frame& frame);

// The frame to give to UpdateCloth.
uint32_t StagesOf(const SceneCharacter& character);
uint32_t FlagsOf(const SceneCharacter& character);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_SCENE_SCENE_H_
