/* dcloth: learned cloth inside a game's frame budget. The C ABI, valid C99; the only header a host needs.
 *
 * The way through: open a model from memory you own, ask how much memory one garment needs, lend it, then per network
 * tick call dcloth_cloth_tick and per drawn frame dcloth_cloth_skin.
 *
 * Promises. No function allocates, starts a thread, opens a file, reads a clock, throws or aborts. Model bytes are
 * untrusted: dcloth_model_open checks everything the run path relies on, in every build. Any number of cloths may share
 * one model; calls on different cloths may run on different threads at once, calls on one cloth may not.
 *
 * Rounding mode, flushing of subnormals and trapping exceptions that the host has set neither change a result nor are
 * changed: each call sets them aside, a timer's clock runs in the default environment, and all is restored, sticky flags
 * included (x86, AArch64; WebAssembly has none).
 *
 * Every struct_size is at least sizeof of the struct in this header; a larger one, of a later header, is accepted.
 * Any weights pass dcloth_model_open, even NaN: they give NaN vertices until the next reset, never a fault.
 *
 * Units: metres, seconds, radians. Right-handed, +Y up. Matrices act on column vectors. SIZE is bytes, COUNT elements.
 */
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
  DCLOTH_ERROR_POSE = 7        /* NaN, infinity, a magnitude above 1e9 or a wrong joint count; the state is untouched */
};

/* What went wrong, in words: field, found, allowed, mend. Filled only on failure; owned by the caller; may be null
 * everywhere it is asked for, without changing what is checked. */
typedef struct dcloth_error {
  uint32_t struct_size;   /* set to sizeof(dcloth_error) before the call */
  dcloth_status status;
  uint64_t offset_bytes;  /* where in the model bytes, or UINT64_MAX where no place applies */
  char text[240];         /* always terminated */
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
  const uint16_t* triangles; /* [triangle_count, 3], in the model bytes */
} dcloth_model_info;

/* One pose. Matrix j belongs to joint j of the model; sixteen floats each. */
typedef struct dcloth_pose {
  uint32_t struct_size;          /* set to sizeof(dcloth_pose) */
  uint32_t joint_count;          /* must equal dcloth_model_info.joint_count */
  const float* joint_matrices;   /* [joint_count, 16] joint to world, metres */
  uint32_t column_major;         /* 0: rows are contiguous; 1: columns are contiguous */
} dcloth_pose;

/* Where vertices go. Each vertex is three floats; stride_bytes is the distance between vertices: at least 12, a
 * multiple of 4. Only those twelve bytes of a vertex are read and written. */
typedef struct dcloth_output {
  uint32_t struct_size;          /* set to sizeof(dcloth_output) */
  uint32_t vertex_count;         /* must equal dcloth_model_info.vertex_count */
  float* positions;              /* world space, metres */
  uint32_t position_stride_bytes;
  uint32_t normal_stride_bytes;
  float* normals;                /* unit, world space; null when not wanted */
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
  DCLOTH_STEP_COUNT
};
typedef struct dcloth_timer {
  uint32_t struct_size;              /* set to sizeof(dcloth_timer) */
  uint64_t (*now)(void* context);    /* called at step boundaries; null turns timing off */
  void* context;
  uint64_t elapsed[DCLOTH_STEP_COUNT]; /* added to, never reset */
} dcloth_timer;

/* Library version, "0.1.0". Memory: static. Thread: any. Errors: none. Cost: none. */
DCLOTH_API const char* dcloth_version(void);

/* The instruction set that the kernels chose on this CPU, "avx2" for instance. Memory: static. Thread: any.
 * Errors: none. Cost: a load. */
DCLOTH_API const char* dcloth_isa_name(void);

/* Chooses the instruction set for the whole process: a name dcloth_isa_name may return on this CPU ("scalar" always),
 * or null for the best. For tests and measurements; call it while no cloth is running.
 * Memory: none. Thread: one at a time. Errors: ARGUMENT when the CPU or the build lacks it. Cost: none. */
DCLOTH_API dcloth_status dcloth_isa_select(const char* name);

/* Bytes of memory dcloth_model_open wants for its view; a constant of the build.
 * Memory: none. Thread: any. Errors: none. Cost: none. */
DCLOTH_API size_t dcloth_model_storage_size(void);

/* Checks model bytes and opens a view of them. `bytes` and `storage` stay the caller's and must outlive the model; both
 * start on DCLOTH_ALIGNMENT; `size` is that of the whole file, a multiple of DCLOTH_ALIGNMENT. On failure *model is
 * untouched.
 * Memory: storage only. Thread: any. Errors: ARGUMENT, ALIGNMENT, MEMORY, FORMAT, VERSION, SEMANTICS.
 * Cost: one pass over indices, scales and biases; weights are not touched. */
DCLOTH_API dcloth_status dcloth_model_open(const void* bytes, size_t size, void* storage, size_t storage_size,
                                           dcloth_model** model, dcloth_error* error);

/* Describes a model. Memory: none. Thread: any. Errors: ARGUMENT. Cost: none. */
DCLOTH_API dcloth_status dcloth_model_describe(const dcloth_model* model, dcloth_model_info* info);

/* Name of joint `index`, or null past the end. Memory: in the model bytes. Thread: any. Errors: none. Cost: none. */
DCLOTH_API const char* dcloth_model_joint_name(const dcloth_model* model, uint32_t index);

/* Exact bytes that one cloth needs. Memory: none. Thread: any. Errors: 0 for null. Cost: none. */
DCLOTH_API size_t dcloth_cloth_storage_size(const dcloth_model* model);

/* Places a cloth in lent memory, reset. On failure *cloth is untouched.
 * Memory: storage only. Thread: any. Errors: ARGUMENT, ALIGNMENT, MEMORY. Cost: clears the memory. */
DCLOTH_API dcloth_status dcloth_cloth_create(const dcloth_model* model, void* storage, size_t storage_size,
                                             dcloth_cloth** cloth, dcloth_error* error);

/* Forgets all motion: recurrent state, displacement, velocity. After a teleport, a cut or a spawn.
 * Memory: none. Thread: owner. Errors: ARGUMENT. Cost: clears the state. */
DCLOTH_API dcloth_status dcloth_cloth_reset(dcloth_cloth* cloth);

/* Advances the network by one tick of dcloth_model_info.tick_seconds with the pose at the tick's end. `stages` is one of
 * DCLOTH_STAGES_*, at most what the model holds. A refused pose leaves the state untouched.
 * Memory: none. Thread: owner. Errors: ARGUMENT, POSE. Cost: the network; see `dcloth profile`. */
DCLOTH_API dcloth_status dcloth_cloth_tick(dcloth_cloth* cloth, const dcloth_pose* pose, uint32_t stages,
                                           dcloth_timer* timer);

/* Skins the garment with the pose that is drawn. `blend` in [0, 1] goes from the displacement of the tick before the last
 * one (0) to the last one (1); after a single tick both are that one, before any tick it is zero. Positions and normals may
 * interleave in one vertex buffer. A refused pose leaves the outputs untouched.
 * Memory: none. Thread: owner. Errors: ARGUMENT, POSE. Cost: skinning, and normals when asked for. */
DCLOTH_API dcloth_status dcloth_cloth_skin(dcloth_cloth* cloth, const dcloth_pose* pose, float blend,
                                           const dcloth_output* output, dcloth_timer* timer);

#ifdef __cplusplus
}
#endif

#endif /* DCLOTH_DCLOTH_H_ */
