/* dcloth: learned cloth for games. The C ABI, valid C99. One garment needs this header alone; dcloth_scene.h shares one
 * time budget between many.
 *
 * How to use it: open a model from memory that you own, ask how much memory a cloth needs, lend that memory, then call
 * dcloth_cloth_update once per frame with the time that has passed, the pose and your vertex buffers.
 *
 * Promises. No function allocates memory, starts a thread, opens a file, reads a clock, throws or aborts. Model bytes
 * are not trusted: every build checks all that the run path relies on. Many cloths may share one model. Calls on
 * different cloths may run on different threads at the same time; calls on one cloth may not.
 *
 * Floating-point environment. Each call saves yours, uses its own and restores yours, sticky exception flags included.
 * Your rounding mode, subnormal flushing and traps therefore do not change a result. A timer's clock runs inside the
 * engine's environment. Ticks and frames flush subnormals, because arithmetic on subnormals can take minutes. This
 * holds on x86 and AArch64; WebAssembly has no such environment.
 *
 * struct_size. Set it to sizeof of the struct. Later versions of a struct only add fields at its end. A field that your
 * header does not have reads as zero; a field that your struct has no room for is not written. Hosts compiled with the
 * headers of 0.1.0 run with this library, and hosts compiled with this header run with later ones.
 *
 * Weights may be any bits, even NaN. NaN weights give NaN vertices until the next reset, never a fault.
 *
 * Units: metres, seconds, radians. Default axes: right-handed, +Y up, the character faces +Z and its left is +X in the
 * bind pose; dcloth_cloth_set_space changes them. Matrices act on column vectors. SIZE means bytes, COUNT means
 * elements. */
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
#define DCLOTH_VERSION_MINOR 2
#define DCLOTH_VERSION_PATCH 0
/* 1000000 MAJOR + 1000 MINOR + PATCH */
#define DCLOTH_VERSION_NUMBER 2000

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
  DCLOTH_ERROR_POSE = 7,       /* NaN, infinity, a value over 1e9 (1e12 m after a bind pose), a wrong joint count, or a
                                  bind pose without inverse; nothing changes */
  DCLOTH_ERROR_JOINTS = 8,     /* the host's skeleton lacks joints of the model */
  DCLOTH_ERROR_MODEL = 9       /* a saved state or a fit of another model */
};

/* What went wrong, in words: the field, what was found, what is allowed, how to mend it. Written only on failure. The
 * caller owns it. Every function that takes one also takes null, and checks the same things. */
typedef struct dcloth_error {
  uint32_t struct_size;   /* set to sizeof(dcloth_error) before the call */
  dcloth_status status;
  uint64_t offset_bytes;  /* place in the bytes of the model, state or fit; UINT64_MAX where there is none */
  char text[240];         /* always terminated */
  /* The parts of `text`: where each starts and how many bytes it has; size 0 means that the part is absent. `what` is
   * a field, a tensor or a joint. A long text may be cut, and then lacks its last parts. Since 0.2 */
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
typedef struct dcloth_cloth dcloth_cloth; /* one garment on one character, with its state */

/* Which stages of the network run. Each stage needs the ones before it. Fewer stages are a level of detail. They may
 * change from tick to tick, and the change is blended. A stage that did not run in the last tick starts from zero
 * state. */
enum {
  DCLOTH_STAGES_STATIC = 1,
  DCLOTH_STAGES_SKELETON = 3,
  DCLOTH_STAGES_MESH = 7
};

typedef struct dcloth_model_info {
  uint32_t struct_size;      /* set to sizeof(dcloth_model_info) before the call */
  uint32_t joint_count;      /* matrices per pose; for their names see dcloth_model_joint_name */
  uint32_t vertex_count;
  uint32_t triangle_count;
  uint32_t stages;           /* the DCLOTH_STAGES_* the model holds */
  float tick_seconds;        /* the network's time step */
  uint32_t format_major;
  uint32_t format_minor;
  const char* name;          /* terminated, in the model bytes */
  const char* precision;     /* "fp32", "fp16", "int8" or what the converter was asked for */
  const uint16_t* triangles; /* [triangle_count, 3], in the model bytes; counter-clockwise seen from outside */
  const float* positions;    /* [vertex_count, 3], in the model bytes: the garment in the bind pose of training, in
                                metres and the default axes. Since 0.2 */
  /* The coarse mesh, about half of the vertices, for characters that are far away: see DCLOTH_OUTPUT_COARSE. All are
   * null and 0 in files before format 1.6. Since 0.2 */
  const uint16_t* coarse_vertices;  /* [coarse_vertex_count], in the model bytes, rising: the garment's vertices that it
                                       has; take texture coordinates and materials from there */
  const uint16_t* coarse_triangles; /* [coarse_triangle_count, 3], in the model bytes: indices of coarse vertices */
  uint32_t coarse_vertex_count;
  uint32_t coarse_triangle_count;
  /* Where the garment lies in a texture, for DCLOTH_OUTPUT_TEXTURED: the first vertex_count vertices are the garment's,
   * the others repeat those at seams. All are null and 0 where the model holds no texture coordinates. Since 0.2 */
  const float* texture_coordinates;   /* [textured_vertex_count, 2], in the model bytes: u right, v down from the upper
                                         left, as in glTF */
  const uint16_t* textured_triangles; /* [triangle_count, 3], in the model bytes: indices of textured vertices */
  const uint16_t* seam_vertices;      /* [seam_vertex_count], in the model bytes: the garment's vertex that each of the
                                         others repeats; null without seams */
  uint32_t textured_vertex_count;     /* vertex_count + seam_vertex_count */
  uint32_t seam_vertex_count;
} dcloth_model_info;

/* The host's axes and unit, as the character stands in its bind pose. Conversion costs no time per vertex.
 *   glTF, Godot       left +X, up +Y, forward +Z, 1 (the default)
 *   Unity             left -X, up +Y, forward +Z, 1
 *   Unreal (actor)    left -Y, up +Z, forward +X, 0.01
 *   Blender           left +X, up +Z, forward -Y, 1
 * "World" may be any frame that stays upright: the scene, a vehicle, the character's own root. The cloth does not
 * notice how that frame itself moves. */
enum {
  DCLOTH_AXIS_X = 0,
  DCLOTH_AXIS_MINUS_X = 1,
  DCLOTH_AXIS_Y = 2,
  DCLOTH_AXIS_MINUS_Y = 3,
  DCLOTH_AXIS_Z = 4,
  DCLOTH_AXIS_MINUS_Z = 5
};
enum {
  DCLOTH_JOINT_FRAMES_CONVERTED = 0, /* the joints' own axes were converted together with the world: most engines */
  DCLOTH_JOINT_FRAMES_KEPT = 1       /* the joints keep the axes of training; only the world was converted */
};
typedef struct dcloth_space {
  uint32_t struct_size;   /* set to sizeof(dcloth_space) */
  uint32_t left;          /* DCLOTH_AXIS_* that the character's left points along; all three axes differ */
  uint32_t up;            /* DCLOTH_AXIS_* */
  uint32_t forward;       /* DCLOTH_AXIS_*; the three decide whether the space is left- or right-handed */
  float metres_per_unit;  /* 0.0001 to 1000, for positions in matrices and outputs */
  uint32_t joint_frames;  /* DCLOTH_JOINT_FRAMES_* */
} dcloth_space;

/* One pose: 16 floats for each joint. Without dcloth_cloth_bind_joints, matrix j belongs to joint j of the model; with
 * it, to joint j of the host. */
typedef struct dcloth_pose {
  uint32_t struct_size;          /* set to sizeof(dcloth_pose) */
  uint32_t joint_count;          /* dcloth_model_info.joint_count, or the number of names that were bound */
  const float* joint_matrices;   /* [joint_count, 16] joint to world, without scale, in the host's space */
  uint32_t column_major;         /* 0: rows are contiguous; 1: columns are contiguous */
  uint32_t padding;              /* never read */
} dcloth_pose;

/* One frame of time.
 *
 * The network ticks at its own rate (dcloth_model_info.tick_seconds). Its time grid starts with the first update after
 * a reset. An update runs the ticks that have become due since the last update. Each tick takes the pose of its own
 * moment, blended from the poses of the last three updates. The update then draws the displacement between the last two
 * ticks on the skeleton of the given pose.
 *
 * The pose is never late. The displacement is late by the shortest time that keeps it smooth
 * (dcloth_cloth_info.lag_seconds): by nothing where every frame has its tick, by half a tick at twice the tick rate, by
 * at most one tick at any other rate. The lag settles within the first ticks.
 *
 * Hitch: an update runs at most DCLOTH_MAX_TICKS ticks, the latest ones. Earlier ticks are skipped but count as time
 *   that passed, so the character's speed stays right.
 * Pause: `seconds` 0 runs no tick. The frame is drawn with the pose given, and the same pose gives the same vertices.
 * Teleport: set DCLOTH_FRAME_JUMPED when the character was moved since the last update (a portal, a new world origin).
 *   The jump is then not taken for motion, the cloth hangs as before, and the next tick continues with the last
 *   velocity. A jump without the flag looks like one tick at the highest speed seen in training; a model with patches
 *   takes hips that go faster than 12 m/s for a jump with it.
 * Cut: dcloth_cloth_reset forgets everything. The next update ticks at once, whatever `seconds` says, and draws that
 * tick.
 *
 * A negative, NaN or infinite time is refused with ARGUMENT and changes nothing. A long time is a hitch. */
#define DCLOTH_MAX_TICKS 2
enum {
  /* Spreads each tick over the frames until the next one is due, so that no frame pays for a whole tick. Each frame
   * gets a share that follows its length. The ticks are the same, but later: by half a tick at twice the tick rate,
   * by less than one tick at any rate. Some ticks still run whole: the first after a reset, two that are due in one
   * frame, and ticks of frames as long as a tick. The flag may change from frame to frame. */
  DCLOTH_FRAME_PIPELINED = 1,
  DCLOTH_FRAME_JUMPED = 2, /* the character was moved since the last update; see "Teleport" */
  /* 4 is unused: hosts of 0.1 may set it, and it does nothing. */
  /* No tick starts in this frame. A tick that becomes due waits for the next frame without the flag and takes that
   * frame's pose; the time grid starts anew there. Meanwhile the newest displacement is drawn; before the first tick,
   * none. Use it to choose in which frame a cloth pays. */
  DCLOTH_FRAME_HOLD = 8,
  /* Experimental: may change before 1.0. Stops ticking while the character is idle; frames then cost drawing alone.
   * It takes half a second (15 ticks) in which no joint moved by more than 0.5 mm or turned by more than a
   * thousandth, and no vertex moved by more than 0.05 mm along an axis, neither from tick to tick nor in total. The
   * last of those ticks costs one more basis sum. The cloth ticks again in the first frame with time in which the
   * pose has moved that far or jumped, in which other stages are asked for, or which lacks the flag. */
  DCLOTH_FRAME_FREEZE_IDLE = 16
};
typedef struct dcloth_frame {
  uint32_t struct_size;  /* set to sizeof(dcloth_frame) */
  uint32_t stages;       /* DCLOTH_STAGES_* for ticks that start now; stages that the model lacks are ignored */
  float seconds;         /* since the last update: 0 or more, finite */
  uint32_t flags;        /* DCLOTH_FRAME_* or 0 */
  dcloth_error* error;   /* where an update writes why it was refused; or null. Since 0.2 */
} dcloth_frame;

/* What the last update did. */
typedef struct dcloth_cloth_info {
  uint32_t struct_size;  /* set to sizeof(dcloth_cloth_info) before the call */
  uint32_t in_work;      /* 1 while a tick has begun and is not complete */
  float lag_seconds;     /* how much older the drawn displacement is than the pose */
  float tick_share;      /* network work of the last update by estimated cost; 1 is a whole tick of all its stages */
  uint32_t frozen;       /* 1 while DCLOTH_FRAME_FREEZE_IDLE has stopped the ticks */
  uint32_t tick_waits;   /* 1 if the next update with seconds > 0 starts a tick: the first one, or one that was held */
} dcloth_cloth_info;

/* Number formats of a vertex buffer. Half floats are IEEE 754 binary16. Their steps are 0.5 mm at 0.5 to 1 m from the
 * origin and double with each doubling of that distance. Half positions therefore need an origin near the character
 * that stands still; moving that origin is a DCLOTH_FRAME_JUMPED. */
enum {
  DCLOTH_FORMAT_FLOAT32 = 0,
  DCLOTH_FORMAT_FLOAT16 = 1
};

/* What is done to the vertices of a frame before they are written. */
enum {
  /* Keeps the garment outside of the body. Cloth stays on its side of a limb that the network lets through; its
   * neighbours give way; then each vertex under the character's skin, or less than the model's clearance (4 mm) above
   * it, moves along the normal of the closest skin point until it is outside by the clearance. The cloth remembers
   * where it was drawn in the last frame with this flag; a frame with `seconds` 0 is drawn the same way and remembers
   * nothing. After a reset or half a second without such a frame it starts from the bind pose, which takes the steps
   * of two frames. The network's state does not change. Every step has a fixed bound, so in impossible poses some
   * vertices may stay inside. Only skin that the vertex could touch in training counts. Does nothing where
   * dcloth_model_body_vertex_count is 0. */
  DCLOTH_OUTPUT_OUTSIDE_BODY = 1,
  /* Writes the coarse mesh instead: vertex_count is dcloth_model_info.coarse_vertex_count, vertex i is vertex
   * coarse_vertices[i] of the garment, and normals and tangents are those of coarse_triangles. It costs half of the
   * drawing; the ticks are the same. Not together with DCLOTH_OUTPUT_OUTSIDE_BODY. Since 0.2 */
  DCLOTH_OUTPUT_COARSE = 2,
  /* Writes the vertices that a texture is drawn on, for dcloth_model_info.textured_triangles: vertex_count is
   * textured_vertex_count. The first are the garment's; a seam's others get the same position and normal, and a tangent
   * of their own. Where dcloth_output.texture_coordinates is null, tangents follow the model's. It costs a copy of the
   * seams. Not together with DCLOTH_OUTPUT_COARSE. Since 0.2 */
  DCLOTH_OUTPUT_TEXTURED = 4
};

/* Where the vertices are written. Each attribute has the address of the first vertex, the distance to the next one and
 * a number format. The distance is at least the attribute's size and a multiple of its number's size. Attributes may
 * interleave in one buffer; bytes between them are neither read nor written. A null attribute is skipped at no cost.
 *
 * Half-float attributes need scratch memory. It holds nothing between calls, so all cloths of a thread can share it.
 * With half floats the buffers are only written. With floats alone they are read too: do not point them at GPU memory
 * that is slow to read. */
typedef struct dcloth_output {
  uint32_t struct_size;          /* set to sizeof(dcloth_output) */
  uint32_t vertex_count;         /* must equal dcloth_model_info.vertex_count; with a flag, coarse_ or
                                    textured_vertex_count */
  void* positions;               /* 3 numbers each: world, host's unit */
  uint32_t position_stride_bytes;
  uint32_t normal_stride_bytes;
  void* normals;                 /* 3 numbers each: unit length, outward; or null */
  void* tangents;                /* 4 numbers each: a unit vector along growing u, and w = 1 or -1, where the bitangent
                                    is w cross(normal, tangent). Needs normals and texture_coordinates. Or null */
  const float* texture_coordinates; /* u, v of each vertex; read only for tangents; with
                                       DCLOTH_OUTPUT_TEXTURED the model's where null */
  uint32_t tangent_stride_bytes;
  uint32_t texture_stride_bytes; /* at least 8 */
  uint32_t position_format;      /* DCLOTH_FORMAT_* */
  uint32_t normal_format;        /* DCLOTH_FORMAT_* */
  uint32_t tangent_format;       /* DCLOTH_FORMAT_* */
  uint32_t flags;                /* DCLOTH_OUTPUT_* or 0 */
  float* bounds;                 /* [6] smallest x, y, z, then largest, before rounding to half; or null */
  void* scratch;                 /* on a multiple of 4; null where dcloth_output_scratch_size is 0 */
  uint64_t scratch_size;         /* bytes, at least dcloth_output_scratch_size */
} dcloth_output;

/* Where the time of a call goes. */
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
/* Length of dcloth_timer.elapsed. It never changes; a further step would be a further field. */
#define DCLOTH_TIMER_STEPS 8
typedef struct dcloth_timer {
  uint32_t struct_size;              /* set to sizeof(dcloth_timer) */
  uint64_t (*now)(void* context);    /* the host's clock, in any unit; called between steps. Null: no timing */
  void* context;                     /* given to `now` and `piece` */
  uint64_t elapsed[DCLOTH_TIMER_STEPS]; /* by DCLOTH_STEP_*; added to, never reset */
  /* Called after every piece of a step with its name ("mesh layers", static) and its time; or null. A piece that runs
   * in portions is reported several times. Since 0.2 */
  void (*piece)(void* context, const char* name, uint64_t elapsed);
} dcloth_timer;

/* Returns the library version as text, "0.2.0".
 * Memory: static.
 * Thread: any.
 * Errors: none.
 * Cost: none. */
DCLOTH_API const char* dcloth_version(void);

/* Returns the library version as a number; see DCLOTH_VERSION_NUMBER.
 * Memory: none.
 * Thread: any.
 * Errors: none.
 * Cost: none. */
DCLOTH_API uint32_t dcloth_version_number(void);

/* Returns a status as a word: "OK", "ARGUMENT" and so on.
 *   status  a dcloth_status; any other number gives "UNKNOWN"
 * Memory: static.
 * Thread: any.
 * Errors: none.
 * Cost: none. */
DCLOTH_API const char* dcloth_status_name(dcloth_status status);

/* Returns the name of the instruction set that the kernels use on this CPU, for example "avx2".
 * Memory: static.
 * Thread: any.
 * Errors: none.
 * Cost: a load. */
DCLOTH_API const char* dcloth_isa_name(void);

/* Chooses the instruction set for the whole process. Call it while no cloth is running.
 *   name  one that dcloth_isa_name may return on this CPU, "scalar" (always there) or "reproducible"; null for the best
 * "reproducible" is for lockstep games and replays. The same model file and the same calls give the same bits on x86
 * with SSE4.2, AArch64 and WebAssembly. It takes about twice the time of AVX2. It does not flush subnormals, as
 * WebAssembly cannot: a tick of a model from an untrusted source may then take minutes. Other names are for tests.
 * Vertices differ between them by less than 0.01 mm (int8: on average).
 * Memory: none.
 * Thread: one at a time.
 * Errors: ARGUMENT where the CPU or the build lacks it.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_isa_select(const char* name);

/* Returns the bytes of memory that dcloth_model_open needs for its view. It is a constant of the build.
 * Memory: none.
 * Thread: any.
 * Errors: none.
 * Cost: none. */
DCLOTH_API size_t dcloth_model_storage_size(void);

/* Checks model bytes and opens a view of them. The bytes are used in place: they are not copied, and not checked again.
 *   bytes         the whole .dcloth file, on DCLOTH_ALIGNMENT; must outlive the model and must not change while it is
 *                 in use, so do not map a file that another program may write to
 *   size          bytes of the file, a multiple of DCLOTH_ALIGNMENT
 *   storage       memory for the view, on DCLOTH_ALIGNMENT; must outlive the model
 *   storage_size  at least dcloth_model_storage_size
 *   model         receives the model; untouched on failure
 *   error         receives the reason of a failure; or null
 * Memory: storage only.
 * Thread: any.
 * Errors: ARGUMENT, ALIGNMENT, MEMORY, FORMAT, VERSION, SEMANTICS.
 * Cost: one pass over indices, scales and biases; weights are not read. */
DCLOTH_API dcloth_status dcloth_model_open(const void* bytes, size_t size, void* storage, size_t storage_size,
                                           dcloth_model** model, dcloth_error* error);

/* Describes a model.
 *   info  receives the description; set info->struct_size first
 * Memory: none.
 * Thread: any.
 * Errors: ARGUMENT.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_model_describe(const dcloth_model* model, dcloth_model_info* info);

/* Returns the name of a joint, or null past the end.
 *   index  0 to dcloth_model_info.joint_count - 1
 * Memory: in the model bytes.
 * Thread: any.
 * Errors: none.
 * Cost: none. */
DCLOTH_API const char* dcloth_model_joint_name(const dcloth_model* model, uint32_t index);

/* What dcloth_model_joint_parent returns instead of an index. */
enum {
  DCLOTH_JOINT_TOP = -1,    /* the model has no joint above this one */
  DCLOTH_JOINT_UNKNOWN = -2 /* the file does not say: it is older than format 1.5, or its bundle had no parents */
};

/* Returns the index of the nearest joint above a joint, or DCLOTH_JOINT_*. Joints in between that the model does not
 * have are passed over. Going up from any joint ends at DCLOTH_JOINT_TOP.
 *   index  0 to dcloth_model_info.joint_count - 1
 * Memory: none.
 * Thread: any.
 * Errors: DCLOTH_JOINT_UNKNOWN for null and past the end.
 * Cost: a load. */
DCLOTH_API int32_t dcloth_model_joint_parent(const dcloth_model* model, uint32_t index);

/* Writes a joint's matrix in the bind pose of training. Its last column is the joint's position.
 *   index   0 to dcloth_model_info.joint_count - 1
 *   matrix  receives [16] joint to world: rows contiguous, metres, the default axes; untouched on failure
 * Memory: none.
 * Thread: any.
 * Errors: ARGUMENT for null and past the end; SEMANTICS where the model's matrix has no inverse.
 * Cost: an inverse. */
DCLOTH_API dcloth_status dcloth_model_joint_bind(const dcloth_model* model, uint32_t index, float* matrix);

/* Returns how many vertices the skin has that DCLOTH_OUTPUT_OUTSIDE_BODY keeps cloth out of; 0 where the model holds no
 * skin, as in format 1.1 and before.
 * Memory: none.
 * Thread: any.
 * Errors: 0 for null.
 * Cost: none. */
DCLOTH_API uint32_t dcloth_model_body_vertex_count(const dcloth_model* model);

/* Fills in the output that suits this garment: its vertex count, floats packed one after another, and
 * DCLOTH_OUTPUT_OUTSIDE_BODY where the model holds a body. All pointers are null: set `positions` and whatever else you
 * want before drawing.
 *   output  receives the description; set output->struct_size first
 * Memory: none.
 * Thread: any.
 * Errors: ARGUMENT.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_model_output(const dcloth_model* model, dcloth_output* output);

/* Returns 1 if dcloth_cloth_set_wind changes the motion of this garment, else 0.
 * Memory: none.
 * Thread: any.
 * Errors: 0 for null.
 * Cost: none. */
DCLOTH_API uint32_t dcloth_model_reads_wind(const dcloth_model* model);

/* Returns the exact number of bytes that one cloth needs.
 * Memory: none.
 * Thread: any.
 * Errors: 0 for null.
 * Cost: none. */
DCLOTH_API size_t dcloth_cloth_storage_size(const dcloth_model* model);

/* Places a cloth in lent memory. The cloth is reset.
 *   model         must outlive the cloth
 *   storage       memory on DCLOTH_ALIGNMENT; must outlive the cloth
 *   storage_size  at least dcloth_cloth_storage_size
 *   cloth         receives the cloth; untouched on failure
 *   error         receives the reason of a failure; or null
 * Memory: storage only.
 * Thread: any.
 * Errors: ARGUMENT, ALIGNMENT, MEMORY.
 * Cost: clears the memory; with a skin also 3 ms for 10,000 vertices, to find limbs and what goes around them, and
 *   for files before format 1.5 1 ms more, to sort them. */
DCLOTH_API dcloth_status dcloth_cloth_create(const dcloth_model* model, void* storage, size_t storage_size,
                                             dcloth_cloth** cloth, dcloth_error* error);

/* Finds the model's joints by name in the host's skeleton. Poses then hold one matrix per name. The binding outlives
 * resets. A cloth with a fit looks for the names of the fit's character instead.
 *   names  [count] names of the host's joints; matched exactly, the first of equal names counts. They are not kept
 *   count  1 or more
 *   error  receives the reason of a failure, with the joints that are missing; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, JOINTS; the previous binding stays.
 * Cost: model joints times names. */
DCLOTH_API dcloth_status dcloth_cloth_bind_joints(dcloth_cloth* cloth, const char* const* names, uint32_t count,
                                                  dcloth_error* error);

/* Chooses the host's space for poses and outputs. It outlives resets.
 *   space  axes and unit; see dcloth_space
 *   error  receives the reason of a failure; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT; the previous space stays.
 * Cost: none, then and later. */
DCLOTH_API dcloth_status dcloth_cloth_set_space(dcloth_cloth* cloth, const dcloth_space* space, dcloth_error* error);

/* Takes the character's bind pose from the host, for joints that have axes or a scale of their own. Each joint is then
 * read relative to its bind matrix, and joint_frames no longer counts. The character stands in the same stance, and at
 * the same place, as the training figure did in its bind pose. The bind pose outlives resets, bindings and spaces.
 *   bind   the bind pose, as dcloth_cloth_update takes poses
 *   error  receives the reason of a failure; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, POSE; the previous bind pose stays.
 * Cost: 0.1 us a joint; in each frame after it 0.04 us a joint. */
DCLOTH_API dcloth_status dcloth_cloth_set_bind_pose(dcloth_cloth* cloth, const dcloth_pose* bind, dcloth_error* error);

/* Lays the garment onto another character than that of training, by the bytes of a .dcloth-fit file. `dcloth dress` and
 * the library of dcloth_fit.h make them for one skeleton and garment, in any precision. Poses then hold all joints of
 * that character in its own order; dcloth_cloth_bind_joints after it chooses others. The joints have the axes and the
 * bind pose of the character's file, converted to the host's space, which is set before. A cloth with a fit refuses
 * dcloth_cloth_set_space and dcloth_cloth_set_bind_pose. A fit outlives resets.
 *   fit    the whole file, on DCLOTH_ALIGNMENT. It is used in place, by any number of cloths: it must outlive them or
 *          their next fit, and must not change
 *   size   bytes of the file
 *   error  receives the reason of a failure; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, ALIGNMENT, FORMAT, VERSION, SEMANTICS; MODEL for a fit of another garment. The fit before stays.
 * Cost: a checksum, a check of each number and, with a skin, what dcloth_cloth_create costs. */
DCLOTH_API dcloth_status dcloth_cloth_set_fit(dcloth_cloth* cloth, const void* fit, size_t size, dcloth_error* error);

/* Sets the wind: the velocity of the air relative to the ground. It counts for ticks that start from now on. It is 0
 * until it is set, and outlives resets; saved states do not hold it. A change wakes a cloth that
 * DCLOTH_FRAME_FREEZE_IDLE has frozen. Models that do not read the air ignore it; see dcloth_model_reads_wind.
 *   wind   [3] host units per second along the host's axes, at most 100 m/s
 *   error  receives the reason of a failure; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT; the previous wind stays.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_cloth_set_wind(dcloth_cloth* cloth, const float* wind, dcloth_error* error);

/* Returns the bytes of scratch memory that an output needs. Reads its formats, its attributes and vertex_count alone.
 * Memory: none.
 * Thread: any.
 * Errors: 0 for null.
 * Cost: none. */
DCLOTH_API uint64_t dcloth_output_scratch_size(const dcloth_output* output);

/* Forgets all motion: recurrent state, displacement, velocity and time. Call it after a cut or a spawn.
 * Memory: none. Thread: owner. Errors: ARGUMENT. Cost: clears the state. */
DCLOTH_API dcloth_status dcloth_cloth_reset(dcloth_cloth* cloth);

/* Saved states.
 *
 * A saved state holds all that later frames depend on, a tick in work included. A cloth that restores it continues bit
 * for bit as the saved cloth would have, on the same instruction set or with both on "reproducible". Joint binding,
 * space, bind pose and wind belong to the host and are not saved. The bytes are little-endian and the same on every
 * platform. Their version is 5; a release that cannot read a version refuses it with VERSION.
 *
 * Pause: do not update. Or save, give the memory back, and later create and restore. The first update's `seconds` is
 *   then the frame time, as if nothing had happened in between. Add DCLOTH_FRAME_JUMPED if the character was moved.
 * Untrusted save games: truncated or changed bytes, another version, another model, and numbers that no cloth can have
 *   (NaN, a recurrent state beyond 1, times out of range) are refused. The cloth is then as it was before; reset it
 *   instead.
 * Other model: a state belongs to the model file that it was saved with, which is recognised by the identity in the
 *   file (before format 1.2: by name and sizes). DCLOTH_RESTORE_OTHER_MODEL accepts the state of another file with the
 *   same sizes: the same network in another precision or rank. The state must be saved between ticks.
 * Hot swap of a model: open the new file, create its cloth in other memory, and bind joints and space as before. For
 *   the same network, save the old cloth after an update without DCLOTH_FRAME_PIPELINED, restore it into the new one
 *   with DCLOTH_RESTORE_OTHER_MODEL and continue; the next frame differs by as much as the precisions do. For another
 *   network, update both for about a second, the new one with `output` null, and then draw the new one. Give the old
 *   memory back after its last call. */
enum {
  DCLOTH_RESTORE_OTHER_MODEL = 1 /* only sizes must agree: joints, features, bones, vertices, layers, tick rate */
};

/* Returns the bytes that dcloth_cloth_save writes now: fewer than dcloth_cloth_storage_size, fewest between ticks.
 * Memory: none.
 * Thread: owner.
 * Errors: 0 for null.
 * Cost: none. */
DCLOTH_API size_t dcloth_cloth_state_size(const dcloth_cloth* cloth);

/* Saves the state. Nothing is written on failure.
 *   state  receives the bytes; any address
 *   size   bytes at `state`, at least dcloth_cloth_state_size
 *   error  receives the reason of a failure; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, MEMORY; SEMANTICS where NaN weights have spoiled the state (reset it).
 * Cost: a copy and a checksum. */
DCLOTH_API dcloth_status dcloth_cloth_save(const dcloth_cloth* cloth, void* state, size_t size, dcloth_error* error);

/* Restores a saved state. The cloth is untouched on failure.
 *   state  the saved bytes; any address
 *   size   bytes at `state`
 *   flags  DCLOTH_RESTORE_* or 0
 *   error  receives the reason of a failure; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, FORMAT, VERSION, MODEL, SEMANTICS.
 * Cost: a checksum, a check of each number and a copy. */
DCLOTH_API dcloth_status dcloth_cloth_restore(dcloth_cloth* cloth, const void* state, size_t size, uint32_t flags,
                                              dcloth_error* error);

/* Runs the ticks that are due and draws. Call it once per frame, at any frame rate; see dcloth_frame. A refused call
 * leaves state and outputs untouched.
 *   pose    the pose that is drawn
 *   frame   time, stages and flags
 *   output  where vertices are written; null for a garment that is not seen
 *   timer   where times are added; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, POSE; frame->error says why.
 * Cost: the ticks that are due, or their share, and the cost of dcloth_cloth_skin. */
DCLOTH_API dcloth_status dcloth_cloth_update(dcloth_cloth* cloth, const dcloth_pose* pose, const dcloth_frame* frame,
                                             const dcloth_output* output, dcloth_timer* timer);

/* Describes the last update.
 *   info  receives the description; set info->struct_size first
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT.
 * Cost: none. */
DCLOTH_API dcloth_status dcloth_cloth_describe(const dcloth_cloth* cloth, dcloth_cloth_info* info);

/* Advances the network by one tick of dcloth_model_info.tick_seconds. dcloth_cloth_tick + dcloth_cloth_skin =
 * dcloth_cloth_update, for hosts that keep their own clock at the tick rate. A tick that an update left in work is
 * completed first, and the next tick of an update is due one tick later. A refused pose leaves the state untouched.
 *   pose    the pose at the end of the tick
 *   stages  DCLOTH_STAGES_*; stages that the model lacks are ignored
 *   timer   where times are added; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, POSE.
 * Cost: the network; see `dcloth profile`. */
DCLOTH_API dcloth_status dcloth_cloth_tick(dcloth_cloth* cloth, const dcloth_pose* pose, uint32_t stages,
                                           dcloth_timer* timer);

/* Draws: skins the garment with a pose. Before the first tick the displacement is zero. A refused pose leaves the
 * outputs untouched.
 *   pose    the pose that is drawn
 *   blend   0 draws the displacement of the tick before the last, 1 that of the last tick, values between blend them;
 *           after a single tick both are that tick
 *   output  where vertices are written
 *   timer   where times are added; or null
 * Memory: none.
 * Thread: owner.
 * Errors: ARGUMENT, POSE.
 * Cost: skinning, and normals and tangents if asked for. */
DCLOTH_API dcloth_status dcloth_cloth_skin(dcloth_cloth* cloth, const dcloth_pose* pose, float blend,
                                           const dcloth_output* output, dcloth_timer* timer);

#ifdef __cplusplus
}
#endif

#endif /* DCLOTH_DCLOTH_H_ */
