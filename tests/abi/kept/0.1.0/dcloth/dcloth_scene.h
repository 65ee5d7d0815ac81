/* dcloth: many characters in one budget. Part of the C ABI, valid C99, on top of dcloth.h, whose promises hold here
 * too.
 *
 * Each frame dcloth_scene_plan chooses a level for every character and whether its tick runs in this frame, from
 * costs that the host measured (dcloth profile, or dcloth_timer in the game). It reads the cloths and changes none;
 * the host then gives each cloth the stages and flags of dcloth_scene_get, with the same `seconds`, in any order and
 * on any threads. Plan while no cloth of the scene is being updated. Numbers above 1e9 count as 1e9.
 *
 * Promises, in costs as given: a plan never costs more than the budget where the budget covers the drawing of all.
 * Where it also covers the longest tick of a level held, each character ticks at latest as many frames after its tick
 * fell due as there are characters, and one at FROZEN at latest as many frames after a second. Cloths that are idle
 * cost no tick; the frame in which one wakes is paid from what the others leave, else it is the next. */
#ifndef DCLOTH_DCLOTH_SCENE_H_
#define DCLOTH_DCLOTH_SCENE_H_

#include "dcloth/dcloth.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct dcloth_scene dcloth_scene;

/* What a character gets. */
enum {
  DCLOTH_LEVEL_FROZEN = 0,     /* keeps its displacement; the static stage once a second */
  DCLOTH_LEVEL_STATIC,         /* DCLOTH_STAGES_STATIC, and so on */
  DCLOTH_LEVEL_SKELETON,
  DCLOTH_LEVEL_HALF_RATE_MESH, /* DCLOTH_STAGES_MESH with DCLOTH_FRAME_HALF_RATE_MESH */
  DCLOTH_LEVEL_MESH,
  DCLOTH_LEVEL_COUNT
};

typedef struct dcloth_scene_character {
  uint32_t struct_size;     /* set to sizeof(dcloth_scene_character) */
  uint32_t top_level;       /* DCLOTH_LEVEL_*: no higher one is wanted; the model may hold less */
  const dcloth_cloth* cloth; /* outlives its place in the scene */
  float importance;         /* 0 or more, say the share of the screen; only ratios matter. 0 stays FROZEN */
  float draw_microseconds;  /* of a frame without a tick, on one core; 0 where nothing is drawn */
  /* Of one tick at each level; FROZEN is not read. HALF_RATE_MESH is that of a tick in which the mesh stage rests;
   * those in which it runs cost MESH's. */
  float tick_microseconds[DCLOTH_LEVEL_COUNT];
  /* How far off each level looks, from `dcloth evaluate`: it tells which raise is worth most. */
  float error_mm[DCLOTH_LEVEL_COUNT];
} dcloth_scene_character;

typedef struct dcloth_scene_frame {
  uint32_t struct_size;       /* set to sizeof(dcloth_scene_frame) */
  float seconds;              /* the frame time that the updates will be given: 0 or more, finite */
  float budget_microseconds;  /* for all updates of the frame together, 0 or more, finite */
  float spent_microseconds;   /* what the updates of the last plan really took, or 0: costs are scaled to it */
} dcloth_scene_frame;

/* A character's part of the last plan. */
typedef struct dcloth_scene_choice {
  uint32_t struct_size;  /* set to sizeof(dcloth_scene_choice) before the call */
  uint32_t level;        /* DCLOTH_LEVEL_* */
  uint32_t stages;       /* for dcloth_frame */
  uint32_t flags;        /* for dcloth_frame; DCLOTH_FRAME_JUMPED may be added, DCLOTH_FRAME_PIPELINED not */
  uint32_t ticks;        /* that the frame runs */
  float microseconds;    /* planned for it, as measured before scaling */
  float stale_seconds;   /* since it was last given a tick, this frame included */
} dcloth_scene_choice;

/* Exact bytes that a scene of up to `character_count` characters needs; 1 to 65536.
 * Memory: none. Thread: any. Errors: 0 for other counts. Cost: none. */
DCLOTH_API size_t dcloth_scene_storage_size(uint32_t character_count);

/* Places a scene of empty slots in lent memory. On failure *scene is untouched.
 * Memory: storage only. Thread: any. Errors: ARGUMENT, ALIGNMENT, MEMORY. Cost: clears the memory. */
DCLOTH_API dcloth_status dcloth_scene_create(uint32_t character_count, void* storage, size_t storage_size,
                                             dcloth_scene** scene, dcloth_error* error);

/* Puts a character into slot `index`, as one that was never ticked; null empties the slot.
 * Memory: none. Thread: owner. Errors: ARGUMENT (numbers negative, NaN or infinite too); the slot stays. Cost: none. */
DCLOTH_API dcloth_status dcloth_scene_set(dcloth_scene* scene, uint32_t index,
                                          const dcloth_scene_character* character);

/* Changes a character's importance; every frame if need be.
 * Memory: none. Thread: owner. Errors: ARGUMENT; the importance stays. Cost: none. */
DCLOTH_API dcloth_status dcloth_scene_set_importance(dcloth_scene* scene, uint32_t index, float importance);

/* Plans a frame. `planned_microseconds` may be null; above the budget only where drawing alone is.
 * Memory: none. Thread: owner. Errors: ARGUMENT; the last plan stays. Cost: N log N of some ten nanoseconds. */
DCLOTH_API dcloth_status dcloth_scene_plan(dcloth_scene* scene, const dcloth_scene_frame* frame,
                                           float* planned_microseconds);

/* Tells a character's part of the last plan.
 * Memory: none. Thread: owner. Errors: ARGUMENT, an empty slot too. Cost: none. */
DCLOTH_API dcloth_status dcloth_scene_get(const dcloth_scene* scene, uint32_t index, dcloth_scene_choice* choice);

#ifdef __cplusplus
}
#endif

#endif /* DCLOTH_DCLOTH_SCENE_H_ */
