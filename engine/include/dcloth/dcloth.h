/* dcloth: learned cloth inside a game's frame budget. The C ABI, valid C99; the only header a garment needs
 * (many in one budget: dcloth_scene.h).
 *
 * The way through: open a model from memory you own, ask how much memory one garment needs, lend it, then
 * call dcloth_cloth_update once per frame with the time that has passed, the pose and your vertex buffers.
 *
 * Promises. No function allocates, starts a thread, opens a file, reads a clock, throws or aborts. Model bytes are
 * untrusted: dcloth_model_open checks everything the run path relies on, in every build. Any number of cloths may
 * share one model; calls on different cloths may run on different threads at once, calls on one cloth may not.
 *
 * Rounding mode, flushing of subnormals and trapping exceptions that the host has set neither change a result nor
 * are changed: each call sets them aside, a timer's clock runs in the engine's, and all is restored, sticky flags
 * included (x86, AArch64; WebAssembly has none). Ticks and frames flush subnormals, which else could take minutes.
 *
 * struct_size is sizeof of the struct in the header that a host was compiled with. A struct only grows at its end: fields
 * that a host does not know read as zero, and those that it has no room for are not written. So a host compiled with the
 * headers of 0.1.0 runs with this library, and one compiled with these with a later one.
 * Any weights pass dcloth_model_open, even NaN: they give NaN vertices until the next reset, never a fault.
 *
 * Units: metres, seconds, radians. Right-handed, +Y up, the character faces +Z with its left along +X in the bind
 * pose; dcloth_cloth_set_space takes any other space. Matrices act on column vectors. SIZE is bytes, COUNT elements. */
#ifndef DCLOTH_DCLOTH_H_
#define DCLOTH_DCLOTH_H_

#include <stddef.h>
#include <stdint.h>

#if defined(DCLOTH_SHARED) && defined(_WIN32)
#if defined(DCLOTH_BUILDING)
#define DCLOTH_API __declspec(dllexport)
#else
#define DCLOTH_API __declspec(dllimport)
#endif
#elif defined(__GNUC__)
#define DCLOTH_API __attribute__((visibility("default")))
#else
#define DCLOTH_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define DCLOTH_VERSION_MAJOR 0
#define DCLOTH_VERSION_MINOR 1
#define DCLOTH_VERSION_PATCH 0
/* 1000000 MAJOR + 1000 MINOR + PATCH */
#define DCLOTH_VERSION_NUMBER 1000

/* Model bytes and lent memory start on a multiple of this. */
#define DCLOTH_ALIGNMENT 64

typedef int32_t dcloth_status;
enum {
  DCLOTH_OK = 0,
  DCLOTH_ERROR_ARGUMENT = 1,   /* a null pointer, a wrong count, an unknown flag */
  DCLOTH_ERROR_ALIGNMENT = 2,  /* model bytes or lent memory not on DCLOTH_ALIGNMENT */
  DCLOTH_ERROR_MEMORY = 3,     /* lent memory smaller than asked for */
  DCLOTH_ERROR_FORMAT = 4,     /* not a .dcloth file, truncated, or structurally broken */
  DCLOTH_ERROR_VERSION = 5,    /* a .dcloth file of another major version */
  DCLOTH_ERROR_SEMANTICS = 6,  /* structure intact, content impossible: shapes, indices, scales, ranges */
  DCLOTH_ERROR_POSE = 7,       /* NaN, infinity, over 1e9 or, by a bind pose, 1e12 m; a wrong joint count; a bind pose without
                                  inverse. Nothing changes */
  DCLOTH_ERROR_JOINTS = 8,     /* the host's skeleton lacks joints of the model */
  DCLOTH_ERROR_MODEL = 9       /* a saved state of another model */
};

/* What went wrong, in words: field, found, allowed, mend. Filled only on failure; owned by the caller; may be null
 * everywhere it is asked for, without changing what is checked. */
typedef struct dcloth_error {
  uint32_t struct_size;   /* set to sizeof(dcloth_error) before the call */
  dcloth_status status;
  uint64_t offset_bytes;  /* where in the model's or state's bytes, or UINT64_MAX where no place applies */
  char text[240];         /* always terminated */
  /* Parts of `text`: the first byte of each and how many there are, 0 where there is no such part. `what` is a field, a
   * tensor or a joint; the text may have been too short for the rest. Since 0.2 */
  uint16_t what_at;
  uint16_t what_size;
  uint16_t found_at;
  uint16_t found_size;
  uint16_t allowed_at;
  uint16_t allowed_size;
  uint16_t mend_at;
  uint16_t mend_size;
} dcloth_error;

typedef struct dcloth_model dcloth_model; /* read-only view of model bytes */
typedef struct dcloth_cloth dcloth_cloth; /* one garment on one character: recurrent state and displacement */

/* Which stages run. A later stage needs the ones before it. Fewer stages are a level of detail: they may change from
 * tick to tick, the change is blended like any motion, and a stage that rested for a tick starts from zero state. */
enum {
  DCLOTH_STAGES_STATIC = 1,
  DCLOTH_STAGES_SKELETON = 3,
  DCLOTH_STAGES_MESH = 7
};

typedef struct dcloth_model_info {
  uint32_t struct_size;      /* set to sizeof(dcloth_model_info) before the call */
  uint32_t joint_count;      /* matrices per pose, see dcloth_model_joint_name */
  uint32_t vertex_count;
  uint32_t triangle_count;
  uint32_t stages;           /* the DCLOTH_STAGES_* the model holds */
  float tick_seconds;        /* the network's time step */
  uint32_t format_major;
  uint32_t format_minor;
  const char* name;          /* terminated, lives as long as the model bytes */
  const char* precision;     /* "fp32", "fp16", "int8" or what the converter was asked for */
  const uint16_t* triangles; /* [triangle_count, 3], in the model bytes; counter-clockwise seen from outside */
  const float* positions;    /* [vertex_count, 3], in the model bytes: the garment in the bind pose of training, in metres,
                                +Y up, facing +Z, left +X. Since 0.2 */
} dcloth_model_info;

/* The host's axes and unit. World and joints are the host's; the way into the model's space and back is
 * part of the matrices that are computed anyway, and costs no time per vertex. "World" may be any frame
 * that does not turn over, a vehicle or the character's own root too: what it does is then no motion for the cloth.
 *   glTF, Godot       left +X, up +Y, forward +Z, 1 (the default)
 *   Unity             left -X, up +Y, forward +Z, 1
 *   Unreal (actor)    left -Y, up +Z, forward +X, 0.01
 *   Blender           left +X, up +Z, forward -Y, 1
 * The axes are those of the character in its bind pose. */
enum {
  DCLOTH_AXIS_X = 0,
  DCLOTH_AXIS_MINUS_X = 1,
  DCLOTH_AXIS_Y = 2,
  DCLOTH_AXIS_MINUS_Y = 3,
  DCLOTH_AXIS_Z = 4,
  DCLOTH_AXIS_MINUS_Z = 5
};
enum {
  DCLOTH_JOINT_FRAMES_CONVERTED = 0, /* joints' own axes were turned with the world: most engines */
  DCLOTH_JOINT_FRAMES_KEPT = 1       /* joints keep the axes of training, only the world is turned */
};
typedef struct dcloth_space {
  uint32_t struct_size;   /* set to sizeof(dcloth_space) */
  uint32_t left;          /* DCLOTH_AXIS_* that the character's left points along; the three axes differ */
  uint32_t up;
  uint32_t forward;       /* handedness follows from the three */
  float metres_per_unit;  /* 0.0001 to 1000; of positions in matrices and outputs */
  uint32_t joint_frames;  /* DCLOTH_JOINT_FRAMES_* */
} dcloth_space;

/* One pose, sixteen floats a matrix. Matrix j belongs to joint j of the model or, after
 * dcloth_cloth_bind_joints, to the host's joint j. */
typedef struct dcloth_pose {
  uint32_t struct_size;          /* set to sizeof(dcloth_pose) */
  uint32_t joint_count;          /* dcloth_model_info.joint_count, or the count of names bound */
  const float* joint_matrices;   /* [joint_count, 16] joint to world, unscaled, in the host's space */
  uint32_t column_major;         /* 0: rows are contiguous; 1: columns are contiguous */
  uint32_t padding;              /* never read */
} dcloth_pose;

/* One frame of time.
 *
 * The network ticks at its own rate (dcloth_model_info.tick_seconds) on a grid that starts with the first update
 * after a reset. An update runs the ticks that have become due since the last one, each with the pose of its own
 * moment, blended from the poses of the last three updates; then it draws the displacement between the last two
 * ticks on the skeleton of this very pose. The pose is never late; the displacement is late by the shortest time
 * that keeps it smooth (dcloth_cloth_info.lag_seconds): nothing where each frame has its tick, half a tick at twice
 * the tick rate, up to one tick at any other rate. It settles within the first ticks.
 *
 * Hitch: at most DCLOTH_MAX_TICKS ticks run per update, the latest ones. Those before them are skipped and count as
 *   time that passed, so the character's speed stays right.
 * Pause: `seconds` 0 runs no tick; the frame is drawn with the pose given, and the same pose gives the same
 *   vertices.
 * Teleport: DCLOTH_FRAME_JUMPED tells that the character was moved since the last update (a portal, a new world
 *   origin) and keeps the cloth as it hangs: nothing is taken for motion, and the next tick carries on with the last
 *   velocity. A jump that is not announced looks like one tick at the highest speed seen in training.
 * Cut: dcloth_cloth_reset forgets everything; the next update ticks at once, whatever `seconds` says, and draws that
 *   tick.
 * Time that is negative, NaN or infinite is refused with ARGUMENT and the state is untouched; any other is a hitch. */
#define DCLOTH_MAX_TICKS 2
enum {
  /* Spread a tick over the frames until the next one is due, each with a part that follows its length, so that no
   * frame pays for all of it. The ticks are the same, and late by about (tick_seconds - one frame) more: half a tick
   * at twice the tick rate, less than one at any. The first tick after a reset still runs whole, and so do ticks
   * that are due in one frame with another, and those of frames as long as a tick. The flag may change from frame to
   * frame. */
  DCLOTH_FRAME_PIPELINED = 1,
  DCLOTH_FRAME_JUMPED = 2,
  /* Experimental: may change before 1.0. The mesh stage runs in every second tick, which saves nearly half of its time; the stages before it run in each.
   * Its part of the displacement is drawn one tick later than the rest, on a straight way from one run to the next.
   * The first tick, after a reset too, runs it. For ticks that start now; without DCLOTH_STAGES_MESH it does nothing. */
  DCLOTH_FRAME_HALF_RATE_MESH = 4,
  /* No tick starts in this frame. One that falls due waits for the next frame without the flag, runs there with that
   * frame's pose, and the grid starts anew with it: so hosts choose in which frame a cloth pays. Meanwhile the newest
   * displacement is drawn, before the first tick the garment without any. */
  DCLOTH_FRAME_HOLD = 8,
  /* Experimental: may change before 1.0. Freeze while idle. After half a second (15 ticks) in which no joint moved by more than 0.5 mm or turned by more
   * than a thousandth, and no vertex by more than 0.05 mm along an axis, neither from tick to tick nor in all, ticks
   * stop and frames cost drawing only; the last of those ticks costs a basis sum more. The first frame with time whose
   * pose has moved that far, that jumped, or that asks for other stages has its tick at once. A frame without the flag
   * wakes too. */
  DCLOTH_FRAME_FREEZE_IDLE = 16
};
typedef struct dcloth_frame {
  uint32_t struct_size;  /* set to sizeof(dcloth_frame) */
  uint32_t stages;       /* one of DCLOTH_STAGES_*, for ticks that start now; all of the model's where it holds fewer */
  float seconds;         /* since the last update: 0 or more, finite */
  uint32_t flags;        /* DCLOTH_FRAME_* or 0 */
  dcloth_error* error;   /* says why an update was refused; or null. Since 0.2 */
} dcloth_frame;

/* What the last update did. */
typedef struct dcloth_cloth_info {
  uint32_t struct_size;  /* set to sizeof(dcloth_cloth_info) before the call */
  uint32_t in_work;      /* 1 while a tick is begun and not complete */
  float lag_seconds;     /* by how much the displacement drawn is older than the pose */
  float tick_share;      /* network work of the last update in ticks, by estimated cost: 1 is a whole tick of all
                            its stages */
  uint32_t frozen;       /* 1 while DCLOTH_FRAME_FREEZE_IDLE lets ticks rest */
  uint32_t tick_waits;   /* 1 where the next frame with time has a tick, however short it is: the first, or held */
} dcloth_cloth_info;

/* Numbers in a vertex buffer. Half floats are IEEE 754 binary16; their steps are 0.5 mm at 0.5 to 1 m from
 * the origin and double with each doubling of the distance, so half positions want an origin near the
 * character that stands still; moving it is a DCLOTH_FRAME_JUMPED. */
enum {
  DCLOTH_FORMAT_FLOAT32 = 0,
  DCLOTH_FORMAT_FLOAT16 = 1
};

/* What is done to a frame's vertices before they go out. */
enum {
  /* Move vertices that lie under the character's skin, or less than the model's clearance (2 mm) above it, along the
   * normal of the closest point of the posed skin until they are outside by the clearance. All others stay, and so do
   * some in poses that no body takes: a frame's search is bounded. Each frame on its own, the network's state knows
   * nothing of it. Only skin counts that the vertex collided with in training; dcloth_model_body_vertex_count. */
  DCLOTH_OUTPUT_OUTSIDE_BODY = 1
};

/* Where vertices go. Attribute by attribute: the first vertex's place, the distance to the next one's (at least the
 * attribute's own bytes, a multiple of its number's), the numbers' format. Attributes may interleave in one buffer;
 * nothing between them is read or written. Null attributes are not wanted and cost nothing. A half among the wanted
 * formats needs scratch; it holds nothing between calls, and all cloths of a thread can share it. The buffers are then
 * only written; where all are floats they are read, too: not for GPU memory that is slow to read. */
typedef struct dcloth_output {
  uint32_t struct_size;          /* set to sizeof(dcloth_output) */
  uint32_t vertex_count;         /* must equal dcloth_model_info.vertex_count */
  void* positions;               /* 3 numbers, world, host's unit */
  uint32_t position_stride_bytes;
  uint32_t normal_stride_bytes;
  void* normals;                 /* 3 numbers, unit length, outward; or null */
  void* tangents;                /* 4 numbers: unit, along growing u; w 1 or -1, and the bitangent is
                                    w cross(normal, tangent). Or null. Wants normals and texture_coordinates */
  const float* texture_coordinates; /* u, v of each vertex */
  uint32_t tangent_stride_bytes;
  uint32_t texture_stride_bytes; /* at least 8 */
  uint32_t position_format;      /* DCLOTH_FORMAT_* */
  uint32_t normal_format;
  uint32_t tangent_format;
  uint32_t flags;                /* DCLOTH_OUTPUT_* or 0 */
  float* bounds;                 /* [6] least x, y, z, then greatest, before rounding to half; or null */
  void* scratch;                 /* floats; null where dcloth_output_scratch_size is 0 */
  uint64_t scratch_size;
} dcloth_output;

/* Time spent per stage, in the units of the host's own clock. */
enum {
  DCLOTH_STEP_POSE = 0,      /* checks, heading frame, features */
  DCLOTH_STEP_STATIC,        /* pivot increments */
  DCLOTH_STEP_SKELETON,      /* GRU */
  DCLOTH_STEP_MESH,          /* body points, GSGRU layers, vertex MLP */
  DCLOTH_STEP_DISPLACEMENT,  /* basis sum */
  DCLOTH_STEP_SKINNING,
  DCLOTH_STEP_NORMALS,
  DCLOTH_STEP_PENETRATION,   /* runs before normals */
  DCLOTH_STEP_COUNT
};
/* Length of an array inside a struct, which never changes: one more step is one more field. */
#define DCLOTH_TIMER_STEPS 8
typedef struct dcloth_timer {
  uint32_t struct_size;              /* set to sizeof(dcloth_timer) */
  uint64_t (*now)(void* context);    /* called at step boundaries; null turns timing off */
  void* context;
  uint64_t elapsed[DCLOTH_TIMER_STEPS]; /* of each DCLOTH_STEP_*; added to, never reset */
  /* Called after every piece of a step with its name ("mesh layers", static) and its time; or null. A piece that is run in
     portions, or interleaved with another, comes several times. */
  void (*piece)(void* context, const char* name, uint64_t elapsed);
} dcloth_timer;

/* Library version, "0.1.0". Memory: static. Thread: any. Errors: none. Cost: none. */
DCLOTH_API const char* dcloth_version(void);

/* Library version as a number, see DCLOTH_VERSION_NUMBER. Memory: none. Thread: any. Errors: none. Cost: none. */
DCLOTH_API uint32_t dcloth_version_number(void);

/* A status as a word: "OK", "ARGUMENT" and so on; "UNKNOWN" for numbers that are none. Memory: static. Thread: any.
 * Errors: none. Cost: none. */
DCLOTH_API const char* dcloth_status_name(dcloth_status status);

/* The instruction set that the kernels chose on this CPU, "avx2" for instance. Memory: static. Thread: any.
 * Errors: none. Cost: a load. */
DCLOTH_API const char* dcloth_isa_name(void);

/* Chooses the instruction set for the whole process: a name dcloth_isa_name may return on this CPU ("scalar" always),
 * or null for the best; call it while no cloth is running. "reproducible", for lockstep games and replays, gives the
 * same bits from the same model file and calls on x86 with SSE4.2, AArch64 and WebAssembly, in about twice AVX2's time;
 * it flushes no subnormals, as WebAssembly cannot: there, a stranger's model may take minutes for a tick. Between
 * others, for tests alone, vertices differ by less than 0.01 mm (int8: their mean).
 * Memory: none. Thread: one at a time. Errors: ARGUMENT when the CPU or the build lacks it. Cost: none. */
DCLOTH_API dcloth_status dcloth_isa_select(const char* name);

/* Bytes of memory dcloth_model_open wants for its view; a constant of the build.
 * Memory: none. Thread: any. Errors: none. Cost: none. */
DCLOTH_API size_t dcloth_model_storage_size(void);

/* Checks model bytes and opens a view of them. `bytes` and `storage` stay the caller's and must outlive the model. The
 * bytes must not change meanwhile: they are used where they lie and not checked again, so a file mapped into memory that
 * somebody else writes to is a fault. Both start on DCLOTH_ALIGNMENT; `size` is that of the whole file, a multiple of DCLOTH_ALIGNMENT. On failure *model is
 * untouched.
 * Memory: storage only. Thread: any. Errors: ARGUMENT, ALIGNMENT, MEMORY, FORMAT, VERSION, SEMANTICS.
 * Cost: one pass over indices, scales and biases; weights are not touched. */
DCLOTH_API dcloth_status dcloth_model_open(const void* bytes, size_t size, void* storage, size_t storage_size,
                                           dcloth_model** model, dcloth_error* error);

/* Describes a model. Memory: none. Thread: any. Errors: ARGUMENT. Cost: none. */
DCLOTH_API dcloth_status dcloth_model_describe(const dcloth_model* model, dcloth_model_info* info);

/* Name of joint `index`, or null past the end. Memory: in the model bytes. Thread: any. Errors: none. Cost: none. */
DCLOTH_API const char* dcloth_model_joint_name(const dcloth_model* model, uint32_t index);

/* What dcloth_model_joint_parent returns instead of an index. */
enum {
  DCLOTH_JOINT_TOP = -1,    /* no joint of the model is above this one */
  DCLOTH_JOINT_UNKNOWN = -2 /* the file does not tell: before format 1.5, or its bundle did not */
};

/* Returns the index of the nearest joint above joint `index`, or DCLOTH_JOINT_*. A joint in between that the model does
 * not read is passed over. Walking up from any joint ends at DCLOTH_JOINT_TOP.
 * Memory: none. Thread: any. Errors: DCLOTH_JOINT_UNKNOWN for null and past the end. Cost: a load. */
DCLOTH_API int32_t dcloth_model_joint_parent(const dcloth_model* model, uint32_t index);

/* Writes joint `index`'s matrix in the bind pose of training into `matrix`, [16]: joint to world, rows contiguous, in
 * metres, +Y up, facing +Z, left +X. Its last column is where the joint was.
 * Memory: none. Thread: any. Errors: ARGUMENT for null and past the end, SEMANTICS where the model's matrix has no inverse;
 * `matrix` is then untouched. Cost: an inverse. */
DCLOTH_API dcloth_status dcloth_model_joint_bind(const dcloth_model* model, uint32_t index, float* matrix);

/* Vertices of the skin that DCLOTH_OUTPUT_OUTSIDE_BODY keeps cloth out of; 0 where the model holds none, as of format
 * 1.1 and before. Memory: none. Thread: any. Errors: 0 for null. Cost: none. */
DCLOTH_API uint32_t dcloth_model_body_vertex_count(const dcloth_model* model);

/* Fills in an output for this garment: its vertex count, floats packed one after another, and DCLOTH_OUTPUT_OUTSIDE_BODY where
 * the model holds a body. Pointers are null; set `positions`, and whatever else is wanted, before drawing. Set
 * output->struct_size first.
 * Memory: none. Thread: any. Errors: ARGUMENT. Cost: none. */
DCLOTH_API dcloth_status dcloth_model_output(const dcloth_model* model, dcloth_output* output);

/* 1 where dcloth_cloth_set_wind changes the garment's motion, else 0. Memory: none. Thread: any. Errors: 0 for null.
 * Cost: none. */
DCLOTH_API uint32_t dcloth_model_reads_wind(const dcloth_model* model);

/* Exact bytes that one cloth needs. Memory: none. Thread: any. Errors: 0 for null. Cost: none. */
DCLOTH_API size_t dcloth_cloth_storage_size(const dcloth_model* model);

/* Places a cloth in lent memory, reset. On failure *cloth is untouched. Memory: storage only. Thread: any. Errors:
 * ARGUMENT, ALIGNMENT, MEMORY. Cost: clears the memory, and puts 8,000 vertices over a skin in order in 1 ms. */
DCLOTH_API dcloth_status dcloth_cloth_create(const dcloth_model* model, void* storage, size_t storage_size,
                                             dcloth_cloth** cloth, dcloth_error* error);

/* Finds the model's joints among the names of the host's skeleton; poses then hold one matrix per name.
 * Exact match; of equal names the first counts. The error text lists the joints that are missing. Names
 * are not kept. Outlives resets.
 * Memory: none. Thread: owner. Errors: ARGUMENT, JOINTS; the binding before stays. Cost: model joints
 * times names. */
DCLOTH_API dcloth_status dcloth_cloth_bind_joints(dcloth_cloth* cloth, const char* const* names, uint32_t count,
                                                  dcloth_error* error);

/* Chooses the host's space for poses and outputs. Outlives resets.
 * Memory: none. Thread: owner. Errors: ARGUMENT; the space before stays. Cost: none, then and later. */
DCLOTH_API dcloth_status dcloth_cloth_set_space(dcloth_cloth* cloth, const dcloth_space* space, dcloth_error* error);

/* Takes the character's bind pose as the host has it, where its joints have axes or scale of their own: each is then
 * read by its way from that pose, and joint_frames counts no more. The body stands as, and where, that of training
 * did. Outlives resets, bindings and spaces. Memory: none. Thread: owner. Errors: ARGUMENT, POSE; what was taken before
 * stays. Cost: 0.1 us a joint, in each frame then 0.04 us a joint. */
DCLOTH_API dcloth_status dcloth_cloth_set_bind_pose(dcloth_cloth* cloth, const dcloth_pose* bind, dcloth_error* error);

/* Sets the wind: how fast the air moves past somebody who stands still. `wind` is [3], in host units a second along the
 * host's axes (metres a second unless dcloth_cloth_set_space says otherwise), at most 100 m/s. It counts for ticks that
 * start from now on and is 0 until it is set. Models without the air in their features ignore it; dcloth_model_reads_wind tells. Outlives resets;
 * saved states do not hold it. Another wind wakes a cloth that DCLOTH_FRAME_FREEZE_IDLE has frozen.
 * Memory: none. Thread: owner. Errors: ARGUMENT; the wind before stays. Cost: none. */
DCLOTH_API dcloth_status dcloth_cloth_set_wind(dcloth_cloth* cloth, const float* wind, dcloth_error* error);

/* Bytes of scratch that an output's formats and attributes need; reads those and vertex_count alone.
 * Memory: none. Thread: any. Errors: 0 for null. Cost: none. */
DCLOTH_API uint64_t dcloth_output_scratch_size(const dcloth_output* output);

/* Forgets all motion: recurrent state, displacement, velocity, time. After a teleport, a cut or a spawn.
 * Memory: none. Thread: owner. Errors: ARGUMENT. Cost: clears the state. */
DCLOTH_API dcloth_status dcloth_cloth_reset(dcloth_cloth* cloth);

/* State that survives.
 *
 * Saved bytes hold all that the frames to come depend on, a tick in work included: a cloth that takes them goes on
 * to the bit as the one that was saved would have, on the same instruction set or both on "reproducible". Joint binding,
 * space and wind are the host's and not among them. They are little-endian and laid out the same on every platform and
 * instruction set; their version is 4, and a release that cannot read one refuses it with VERSION.
 *
 * Pause: do not update, or save, give the memory back, create and restore later. The first update's `seconds` is the
 *   frame time as if nothing had happened in between; where the character was moved, add DCLOTH_FRAME_JUMPED.
 * Save games are untrusted. Truncated or changed bytes, another version, other models, and numbers that no cloth can
 *   have (NaN, a recurrent state beyond 1, times outside of their range) are refused, whatever the checksum says. A
 *   refused cloth is as it was before; reset it instead.
 * Other model: a state belongs to the model file it was saved with, told by the identity that the converter writes
 *   into the file (before format 1.2 by name and sizes). DCLOTH_RESTORE_OTHER_MODEL takes the state of another file
 *   with the same sizes, between ticks, its mesh stage at full rate: the same network in another precision or rank.
 * Hot swap: open the new file and create its cloth in other memory; bind joints and space as before. Then either
 *   save the old cloth after an update without DCLOTH_FRAME_PIPELINED, restore with DCLOTH_RESTORE_OTHER_MODEL and
 *   go on (the frame that follows is off by what the precisions differ); or, for another network, where that is
 *   refused with MODEL or means nothing, update both for about a second, the new one with `output` null, and then
 *   draw the new one. Give the old memory back after its last call. */
enum {
  DCLOTH_RESTORE_OTHER_MODEL = 1 /* only the sizes have to agree: joints, features, bones, vertices, layers, rate */
};

/* Bytes that dcloth_cloth_save writes now: less than dcloth_cloth_storage_size, fewest between ticks.
 * Memory: none. Thread: owner. Errors: 0 for null. Cost: none. */
DCLOTH_API size_t dcloth_cloth_state_size(const dcloth_cloth* cloth);

/* Writes the state into `state`, `size` bytes at any address, of which dcloth_cloth_state_size are used.
 * Memory: none. Thread: owner. Errors: ARGUMENT, MEMORY, SEMANTICS (weights made NaN: reset); nothing is written
 * then. Cost: a copy and a checksum. */
DCLOTH_API dcloth_status dcloth_cloth_save(const dcloth_cloth* cloth, void* state, size_t size, dcloth_error* error);

/* Takes a saved state, `size` bytes at any address. `flags` are DCLOTH_RESTORE_* or 0.
 * Memory: none. Thread: owner. Errors: ARGUMENT, FORMAT, VERSION, MODEL, SEMANTICS; the cloth is untouched. Cost: a
 * checksum, a check of each number and a copy. */
DCLOTH_API dcloth_status dcloth_cloth_restore(dcloth_cloth* cloth, const void* state, size_t size, uint32_t flags,
                                              dcloth_error* error);

/* Runs the ticks that are due and draws: the call for every frame, whatever its rate; see dcloth_frame.
 * `output` may be null for a garment that is not seen. A refused call leaves state and outputs untouched.
 * Memory: none. Thread: owner. Errors: ARGUMENT, POSE; frame->error says why. Cost: due ticks or their share, and
 * dcloth_cloth_skin's. */
DCLOTH_API dcloth_status dcloth_cloth_update(dcloth_cloth* cloth, const dcloth_pose* pose, const dcloth_frame* frame,
                                             const dcloth_output* output, dcloth_timer* timer);

/* Describes the last update. Memory: none. Thread: owner. Errors: ARGUMENT. Cost: none. */
DCLOTH_API dcloth_status dcloth_cloth_describe(const dcloth_cloth* cloth, dcloth_cloth_info* info);

/* The next two are update's halves, for hosts with a clock of their own at the tick rate.
 *
 * Advances the network by one tick of dcloth_model_info.tick_seconds with the pose at the tick's end.
 * `stages` is one of DCLOTH_STAGES_*; all of the model's where it holds fewer. A tick that an update left in work is completed
 * first, and update's next tick is due one tick later. A refused pose leaves the state untouched.
 * Memory: none. Thread: owner. Errors: ARGUMENT, POSE. Cost: the network; see `dcloth profile`. */
DCLOTH_API dcloth_status dcloth_cloth_tick(dcloth_cloth* cloth, const dcloth_pose* pose, uint32_t stages,
                                           dcloth_timer* timer);

/* Skins the garment with the pose that is drawn. `blend` in [0, 1] goes from the displacement of the tick
 * before the last one (0) to the last one (1); after a single tick both are that one, before any tick it
 * is zero. Positions and normals may interleave in one vertex buffer. A refused pose leaves the outputs
 * untouched.
 * Memory: none. Thread: owner. Errors: ARGUMENT, POSE. Cost: skinning, and normals and tangents when asked
 * for. */
DCLOTH_API dcloth_status dcloth_cloth_skin(dcloth_cloth* cloth, const dcloth_pose* pose, float blend,
                                           const dcloth_output* output, dcloth_timer* timer);

#ifdef __cplusplus
}
#endif

#endif /* DCLOTH_DCLOTH_H_ */
