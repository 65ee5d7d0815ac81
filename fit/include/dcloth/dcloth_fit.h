/* dcloth: fits a garment to a character that it was not trained on. Part of the C ABI, valid C99, in a library of its
 * own (dcloth_fit) beside that of dcloth.h, of the same release. Link it where characters are dressed at run time;
 * `dcloth dress HERO -o HERO.dcloth-fit` makes the same fit before, and dcloth_cloth_set_fit reads that.
 *
 * A garment is trained on one figure. Other characters have bones of other lengths, joints with axes of their own,
 * another bind pose (T or A) and another girth. dcloth_cloth_fit reads all of that once: the joints in the bind pose
 * and, if there is one, the skin. After it, pass the character's own matrices in each pose. The fit adds no cost to a
 * frame, with one exception: DCLOTH_OUTPUT_OUTSIDE_BODY keeps cloth 5 mm away from a skin that was given, not 4,
 * because skin of another shape bends otherwise; so it moves some more vertices.
 *
 * The order of calls: open the model, create the cloth, dcloth_cloth_set_space for axes and unit, dcloth_cloth_fit,
 * then update. A rig that would crumple the garment is refused; the error names the joint, what was found, what is
 * allowed and how to mend it. dcloth_fit.warnings tells when a character is far from the figure of training. */
#ifndef DCLOTH_DCLOTH_FIT_H_
#define DCLOTH_DCLOTH_FIT_H_

#include "dcloth/dcloth.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Which part of the body a joint moves. Roles are found by the names of joints. The names of Mixamo, Unity Humanoid,
 * the Unreal mannequin, MakeHuman, Rigify, VRM, CMU, 3ds Max Biped and Character Creator are known, with any prefix,
 * case and separators. */
enum {
  DCLOTH_ROLE_NONE = 0,
  DCLOTH_ROLE_HIPS = 1,
  DCLOTH_ROLE_SPINE = 2,
  DCLOTH_ROLE_CHEST = 3,
  DCLOTH_ROLE_UPPER_CHEST = 4,
  DCLOTH_ROLE_NECK = 5,
  DCLOTH_ROLE_HEAD = 6,
  DCLOTH_ROLE_LEFT_SHOULDER = 7,
  DCLOTH_ROLE_LEFT_UPPER_ARM = 8,
  DCLOTH_ROLE_LEFT_LOWER_ARM = 9,
  DCLOTH_ROLE_LEFT_HAND = 10,
  DCLOTH_ROLE_RIGHT_SHOULDER = 11,
  DCLOTH_ROLE_RIGHT_UPPER_ARM = 12,
  DCLOTH_ROLE_RIGHT_LOWER_ARM = 13,
  DCLOTH_ROLE_RIGHT_HAND = 14,
  DCLOTH_ROLE_LEFT_UPPER_LEG = 15,
  DCLOTH_ROLE_LEFT_LOWER_LEG = 16,
  DCLOTH_ROLE_LEFT_FOOT = 17,
  DCLOTH_ROLE_LEFT_TOES = 18,
  DCLOTH_ROLE_RIGHT_UPPER_LEG = 19,
  DCLOTH_ROLE_RIGHT_LOWER_LEG = 20,
  DCLOTH_ROLE_RIGHT_FOOT = 21,
  DCLOTH_ROLE_RIGHT_TOES = 22
};

/* Length of arrays over roles inside a struct, which never changes. */
#define DCLOTH_FIT_ROLES 32

/* A character in its bind pose: the pose in which its skin was bound to its joints. It must be a standing T or A pose.
 * Matrices and points are in the host's space and in one world. */
typedef struct dcloth_character {
  uint32_t struct_size;           /* set to sizeof(dcloth_character) */
  uint32_t joint_count;           /* of the whole skeleton, 1 to 4096; poses hold as many matrices in this order */
  const char* const* joint_names; /* [joint_count]; may be null where joint_roles is given */
  const uint32_t* joint_roles;    /* [joint_count] DCLOTH_ROLE_*; NONE: by the joint's name. Or null: all by name */
  const float* bind_matrices;     /* [joint_count, 16] joint to world; any axes and scale of a joint's own */
  uint32_t column_major;          /* 0: rows are contiguous; 1: columns are contiguous */
  uint32_t body_vertex_count;     /* of the skin; 0: none */
  const float* body_positions;    /* [body_vertex_count, 3] world, in the bind pose */
  const uint32_t* body_joints;    /* [body_vertex_count, body_influences] indices of joints */
  const float* body_weights;      /* [body_vertex_count, body_influences], 0 or more */
  const uint32_t* body_triangles; /* [body_triangle_count, 3]; or null, then the points must lie close to each other */
  uint32_t body_influences;       /* 1 to 16 */
  uint32_t body_triangle_count;
} dcloth_character;

/* Why a fit may not look right. */
enum {
  DCLOTH_FIT_STAND_IN = 1,     /* the skeleton lacks a joint of the garment; the next one of the body moves its part */
  DCLOTH_FIT_PROPORTIONS = 2,  /* a bone is shorter than 0.75 or longer than 1.33 of the scaled figure's */
  DCLOTH_FIT_STANCE = 4,       /* a limb stands more than 60 degrees (arm) or 25 (leg) from the figure's */
  DCLOTH_FIT_GIRTH = 8,        /* waist or hips are under 0.8 or over 1.25 of the scaled figure's */
  DCLOTH_FIT_GAP = 16,         /* its closest parts are over 15 mm further from the skin than on the figure */
  DCLOTH_FIT_PENETRATION = 32, /* skin stands more than 5 mm out of the garment somewhere */
  DCLOTH_FIT_FACING = 64       /* no toes, no skin of the feet: a swap of left and right would not be noticed */
};

/* How a garment fits. Lengths are real metres of the character by dcloth_space. */
typedef struct dcloth_fit {
  uint32_t struct_size;    /* set to sizeof(dcloth_fit) before the call */
  uint32_t warnings;       /* DCLOTH_FIT_* or 0 */
  float scale;             /* the garment is drawn this many times the size it was trained at */
  float bone_scale;        /* by bones alone: legs and trunk over the figure's */
  float waist_ratio;       /* radius of the waist over that of the figure at bone_scale; 0 without a body */
  float hips_ratio;        /* the same of the hips */
  float gap_mm;            /* mean distance to the skin at rest of the parts closest to it; 0 without a body */
  float penetration_mm;    /* how far skin stands out of the garment at rest at the worst vertex; 0 without a body */
  float penetrating_share; /* of vertices near the skin, with skin more than 1 mm outside of them */
  float stance_degrees;    /* largest turn of a limb between the figure's bind pose and the character's */
  uint32_t stance_role;    /* of that limb */
  uint32_t stand_in_role;  /* first role that DCLOTH_FIT_STAND_IN speaks of; NONE without it */
  float ratios[DCLOTH_FIT_ROLES];   /* by role: bone from this joint to the next over the scaled figure's; 0 unknown */
  int32_t joints[DCLOTH_FIT_ROLES]; /* by role: the character's joint; -1 without one */
  uint64_t file_bytes;     /* of the fit, with which `storage` begins: save them as a .dcloth-fit, or copy them to other
                              memory, call dcloth_cloth_set_fit with that and take `storage` back */
} dcloth_fit;

/* Returns the role of a joint with this name, or DCLOTH_ROLE_NONE for a name that is not known and for null. Joints of
 * the spine are told apart by their height in dcloth_cloth_fit; by name alone the role is a guess.
 *   name  UTF-8, terminated
 * Memory: none.
 * Thread: any.
 * Errors: none.
 * Cost: 1 us. */
DCLOTH_API uint32_t dcloth_role_of_name(const char* name);

/* Returns the name of a role, such as "left upper leg"; "none" for DCLOTH_ROLE_NONE, null for numbers that are no role.
 *   role  DCLOTH_ROLE_*
 * Memory: static.
 * Thread: any.
 * Errors: none.
 * Cost: none. */
DCLOTH_API const char* dcloth_role_name(uint32_t role);

/* Returns how many bytes of storage dcloth_cloth_fit needs for this character.
 *   model      the model of the cloth
 *   character  only the counts are read
 * Memory: none.
 * Thread: any.
 * Errors: 0 for null, for a wrong joint_count, and where dcloth.h's library is of another release.
 * Cost: none. */
DCLOTH_API size_t dcloth_fit_storage_size(const dcloth_model* model, const dcloth_character* character);

/* Fits the cloth to a character; see the top of this header. Poses then hold character->joint_count matrices in the
 * character's order. If there is a body, the cut of the garment and the surface of DCLOTH_OUTPUT_OUTSIDE_BODY are moved
 * onto that skin. Set the space before; what dcloth_cloth_set_fit says holds here. It may be fitted again. The same
 * character gives the same fit on every processor.
 *   cloth         the garment
 *   character     the skeleton, its bind pose and its skin; nothing of it is kept
 *   storage       memory on DCLOTH_ALIGNMENT that outlives the cloth or its next fit
 *   storage_size  at least dcloth_fit_storage_size
 *   fit           receives how the garment fits; or null
 *   error         receives the reason of a failure; or null
 * Memory: storage only.
 * Thread: owner.
 * Errors: ARGUMENT, also for a skin that takes more work than a fit may; ALIGNMENT, MEMORY; JOINTS if the skeleton
 *   lacks parts that the garment needs; POSE for a bind pose with another stance or up axis, swapped sides or
 *   impossible lengths. Nothing changes then, not even in storage that holds the fit before.
 * Cost: 50 us; with a body that of its triangles, of their size and of the vertices beside them: 0.7 s for a person of
 *   10,000 triangles, 1.5 s for 150,000. The work is counted and ends at 420 million steps of 2 to 5 ns. */
DCLOTH_API dcloth_status dcloth_cloth_fit(dcloth_cloth* cloth, const dcloth_character* character, void* storage,
                                          size_t storage_size, dcloth_fit* fit, dcloth_error* error);

#ifdef __cplusplus
}
#endif

#endif /* DCLOTH_DCLOTH_FIT_H_ */
