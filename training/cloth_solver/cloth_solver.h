/* Cloth on a moving body, simulated for training: one C function, called from Python.
 *
 * Extended position-based dynamics with many small steps (Macklin et al., "Small steps in physics simulation", 2019).
 * Cloth is flat fabric cut from a pattern: membrane springs along every edge, softer on the bias than along the
 * threads; bending as the integral of squared curvature (Bergou et al., "A quadratic bending model for inextensible
 * surfaces", 2006), so that the size of the triangles does not change the fabric; quadratic air drag; Coulomb friction
 * against the body; contact between layers. One thread, fixed order, no random numbers: the same input gives the same
 * bits. Lengths in metres, times in seconds, masses in kilograms, +Y up. */
#ifndef DCLOTH_CLOTH_SOLVER_H_
#define DCLOTH_CLOTH_SOLVER_H_

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cloth_solver_settings {
  int32_t steps;           /* a frame */
  int32_t stretch_passes;  /* over the membrane springs in each step */
  float frame_seconds;
  float gravity;           /* m/s^2, along -Y */
  float density;           /* kg/m^2 */
  float stretch;           /* N/m: force per metre of width and unit strain, along warp and weft */
  float bias;              /* N/m: the same at 45 degrees to the threads */
  float compression;       /* share of the stretch stiffness that resists shortening: cloth buckles instead */
  float bend;              /* N m: bending stiffness (Peirce's flexural rigidity) */
  float damping;           /* 1/s: velocities towards their neighbours' mean, the weave's internal friction */
  float drag_normal;       /* drag coefficient of cloth across the flow */
  float drag_tangent;      /* the same along it */
  float air_density;       /* kg/m^3 */
  float friction;          /* Coulomb coefficient, cloth on body */
  float thickness;         /* m, cloth to body */
  float layer_thickness;   /* m, between layers of cloth; 0: layers pass through each other */
  float max_speed;         /* m/s: nothing moves faster; low while a garment is put on */
  float tether;            /* greatest distance from the nearest pinned vertex over their distance along the cloth */
} cloth_solver_settings;

typedef struct cloth_solver_problem {
  int32_t vertices, faces, pinned, body_vertices, body_faces, body_parts, frames;
  const float* start;          /* [vertices, 3] world positions in frame 0 */
  const int32_t* face;         /* [faces, 3] counter-clockwise seen from outside */
  const float* pattern;        /* [faces, 3, 2] corners of each triangle in its flat panel, m; warp runs along +y */
  const float* mass_scale;     /* [vertices] factor on density (hems); NULL: 1 */
  const float* bend_scale;     /* [vertices] factor on bend (seams, hems); NULL: 1 */
  const float* crease;         /* [vertices] pressed pleats: fold angle in radians at the edges between two vertices
                                  whose values share a sign, the smaller one's; > 0 folds outward (mountain);
                                  NULL: none */
  const int32_t* pin;          /* [pinned] cloth vertices that follow pin_path */
  const float* pin_path;       /* [frames, pinned, 3] */
  const int32_t* body_face;    /* [body_faces, 3] outward */
  const int32_t* body_part;    /* [body_faces] part that a face belongs to; a part may be open where it was cut off */
  const float* body_path;      /* [frames, body_vertices, 3] */
  const uint32_t* cloth_part;  /* [vertices] bit p: the vertex touches part p; NULL: every vertex touches every part */
  const float* origin;         /* [frames, 3] a point near the cloth (the hips): floats stay small and precise */
  const float* wind;           /* [frames, 3] velocity of the air, m/s; NULL: still */
  cloth_solver_settings settings;
} cloth_solver_problem;

/* Simulates every frame, frame 0 being the start at rest, into out [frames, vertices, 3]. Returns the number of frames
 * done: less than `frames` when a coordinate stopped being finite or left a 100 m cube, 0 for a malformed problem.
 * Cost: see training/dcloth_training/simulate/README.md. */
int32_t cloth_solver_run(const cloth_solver_problem* problem, float* out);

#ifdef __cplusplus
}
#endif
#endif
