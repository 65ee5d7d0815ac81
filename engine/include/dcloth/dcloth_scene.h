/* dcloth: many characters share one time budget. Experimental: may change before 1.0. Part of the C ABI, valid C99. The
 * promises of dcloth.h hold here too.
 *
 * Each frame, dcloth_scene_plan chooses a level for every character and decides whether its tick runs in this frame. It
 * works with costs that the host measured, by `dcloth profile` or with a dcloth_timer in the game. It reads the cloths
 * and changes none. The host then updates each cloth with the stages and flags of dcloth_scene_get and with the same
 * `seconds`, in any order and on any threads. Do not plan while a cloth of the scene is being updated. Numbers above
 * 1e9 count as 1e9.
 *
 * Drawing has levels of its own (DCLOTH_DRAW_*). Where it takes too much of the budget, characters lose normals in
 * every second frame, then contact, then half of their vertices, then whole frames. A level and a detail compete: what
 * removes most harm per microsecond comes first. Importance is an area: missing detail counts by it, and error, a
 * length, by its square root.
 *
 * Promises, in the costs as given. A plan costs at most the budget, if the budget covers the least drawing of all
 * characters that their costs allow, and beside it one drawing of those that go undrawn in turns. If it also covers the
 * longest tick of the levels in use, no character waits for its tick for more frames than there are characters; a
 * character at FROZEN waits at most that long after a second has passed. Idle cloths cost no tick. The frame in which
 * one wakes is paid from what the others leave over; if that is too little, it wakes in the next frame. */
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
  DCLOTH_LEVEL_MESH = 4,       /* 3 is unused: no character gets it, and as a top_level it counts as SKELETON */
  DCLOTH_LEVEL_COUNT
};

/* What is drawn of a character in a frame. */
enum {
  DCLOTH_DRAW_NONE = 0,  /* update without an output. Keep the vertices of its last drawing and move them with the
                            character's hips; hide a character that was never drawn */
  DCLOTH_DRAW_COARSE,    /* the coarse mesh, with normals: DCLOTH_OUTPUT_COARSE */
  DCLOTH_DRAW_POSITIONS, /* the garment without normals: keep those of its last drawing */
  DCLOTH_DRAW_FULL,      /* the garment with all that you draw of it */
  DCLOTH_DRAW_PLAIN,     /* the same, but not kept outside of the body: without DCLOTH_OUTPUT_OUTSIDE_BODY */
  DCLOTH_DRAW_COUNT
};

/* Length of arrays in dcloth_scene_character. It never changes; a further level would be a further field. */
#define DCLOTH_SCENE_LEVELS 5

typedef struct dcloth_scene_character {
  uint32_t struct_size;     /* set to sizeof(dcloth_scene_character) */
  uint32_t top_level;       /* DCLOTH_LEVEL_*: the highest level wanted; the model may hold less */
  const dcloth_cloth* cloth; /* must outlive its place in the scene */
  float importance;         /* 0 or more, for example the share of the screen; only ratios matter. 0 stays FROZEN */
  float draw_microseconds;  /* cost of a frame without a tick, on one core; 0 if the cloth is not drawn */
  /* Cost of one tick at each level. Those of FROZEN and of the unused level are not read. */
  float tick_microseconds[DCLOTH_SCENE_LEVELS];
  /* Error of each level, from `dcloth evaluate`. It decides which raise is worth most. */
  float error_mm[DCLOTH_SCENE_LEVELS];
  /* Cost of a frame without a tick that draws less: positions alone, the coarse mesh, nothing. Positions or a coarse
   * mesh of cost 0 are never chosen, so that a host that sets nothing here draws everything in every frame.
   * Since 0.2 */
  float positions_microseconds;
  float coarse_microseconds;
  float undrawn_microseconds;
  uint32_t most_undrawn;    /* frames in a row that may pass without drawing it, 0 to 15; larger numbers count as 15.
                               Since 0.2 */
  float plain_microseconds; /* cost of DCLOTH_DRAW_PLAIN; 0: never chosen. Since 0.2 */
  uint32_t padding;         /* never read. Since 0.2 */
} dcloth_scene_character;

typedef struct dcloth_scene_frame {
  uint32_t struct_size;       /* set to sizeof(dcloth_scene_frame) */
  float seconds;              /* the frame time that the updates will be given: 0 or more, finite */
  float budget_microseconds;  /* for all updates of the frame together: 0 or more, finite */
  float spent_microseconds;   /* measured time of the last plan's updates, to which costs are scaled; or 0 */
} dcloth_scene_frame;

/* A character's part of the last plan. */
typedef struct dcloth_scene_choice {
  uint32_t struct_size;  /* set to sizeof(dcloth_scene_choice) before the call */
  uint32_t level;        /* DCLOTH_LEVEL_* */
  uint32_t stages;       /* for dcloth_frame */
  uint32_t flags;        /* for dcloth_frame; you may add DCLOTH_FRAME_JUMPED, not DCLOTH_FRAME_PIPELINED */
  uint32_t ticks;        /* ticks that run in this frame */
  float microseconds;    /* planned cost, in the costs as given, before scaling */
  float stale_seconds;   /* time since the character's last tick, this frame included */
  uint32_t draw;         /* DCLOTH_DRAW_*. Since 0.2 */
} dcloth_scene_choice;

/* Returns the exact number of bytes that a scene needs.
 *   character_count  most characters at a time, 1 to 65536
 * Memory: none.
 * Thread: any.
 * Errors: 0 for other counts.
 * Cost: none. */
DCLOTH_API size_t dcloth_scene_storage_size(uint32_t character_count);

/* Places a scene of empty slots in lent memory.
 *   character_count  most characters at a time, 1 to 65536
 *   storage          memory on DCLOTH_ALIGNMENT; must outlive the scene
 *   storage_size     at least dcloth_scene_storage_size
 *   scene            receives the scene; untouched on failure
 *   error            receives the reason of a failure; or null
 * Memory: storage only.
 * Thread: any.
 * Errors: ARGUMENT, ALIGNMENT, MEMORY.
 * Cost: clears the memory. */
DCLOTH_API dcloth_status dcloth_scene_create(uint32_t character_count, void* storage, size_t storage_size,
                                             dcloth_scene** scene, dcloth_error* error);

/* Puts a character into a slot, as one that never had a tick.
 *   index      0 to character_count - 1
 *   character  the character; null empties the slot
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, for negative, NaN or infinite numbers too; the slot stays as it was.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_scene_set(dcloth_scene* scene, uint32_t index,
                                          const dcloth_scene_character* character);

/* Changes the importance of a character. You may call it every frame.
 *   index       0 to character_count - 1
 *   importance  as in dcloth_scene_character
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT; the importance stays as it was.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_scene_set_importance(dcloth_scene* scene, uint32_t index, float importance);

/* Plans a frame.
 *   frame                 time and budget
 *   planned_microseconds  receives the cost of the plan, which exceeds the budget only if drawing alone does; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT; the last plan stays.
 * Cost: N log N, some ten nanoseconds each. */
DCLOTH_API dcloth_status dcloth_scene_plan(dcloth_scene* scene, const dcloth_scene_frame* frame,
                                           float* planned_microseconds);

/* Returns a character's part of the last plan.
 *   index   0 to character_count - 1
 *   choice  receives the choice; set choice->struct_size first
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, for an empty slot too.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_scene_get(const dcloth_scene* scene, uint32_t index, dcloth_scene_choice* choice);

#ifdef __cplusplus
}
#endif

#endif /* DCLOTH_DCLOTH_SCENE_H_ */
