/* Cloth on a moving body, simulated for training: one C function, called from Python.
 *
 * Extended position-based dynamics with many small steps (Macklin et al., "Small steps in physics simulation", 2019):
 * one pass over all constraints a step, two over stretch. One thread, fixed order, no random numbers: the same input
 * gives the same bits. Lengths in metres, times in seconds, +Y up. A 7,952-vertex skirt at 30 steps a frame costs about
 * 20 ms a frame. */
#ifndef DCLOTH_CLOTH_SOLVER_H_
#define DCLOTH_CLOTH_SOLVER_H_

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct cloth_solver_settings {
  int32_t steps;             /* a frame */
  float frame_seconds;
  float density;             /* kg/m^2 */
  float stretch_compliance;  /* m/N, every mesh edge */
  float bend_stiffness;      /* N/m, between the two vertices opposite an edge: holds the angle of the rest shape */
  float brace_stiffness;     /* N/m, between vertices twelve edges apart: the same over the width of a dent; 0: none */
  float drag_normal;         /* 1/s, velocity against the air along the cloth's normal */
  float drag_tangent;        /* 1/s, along the cloth */
  float air_follows;         /* 0: still air, 1: air turns and travels with the hips */
  float smoothing;           /* 1/s, velocities towards their neighbours' mean: internal friction of the weave */
  float thickness;           /* m, cloth to body */
  float contact_drag;        /* 1/s, sliding velocity against the body where they touch (viscous: it never sticks) */
  float tether;              /* greatest distance from a pinned vertex over the rest distance along the cloth */
} cloth_solver_settings;

typedef struct cloth_solver_problem {
  int32_t vertices, faces, pinned, body_vertices, body_faces, body_parts, frames;
  const float* rest;          /* [vertices, 3] shape without strain, in the place where the simulation starts */
  const int32_t* face;        /* [faces, 3] */
  const int32_t* pin;         /* [pinned] cloth vertices that follow pin_path */
  const float* pin_path;      /* [frames, pinned, 3] */
  const int32_t* body_face;   /* [body_faces, 3] */
  const float* body_path;     /* [frames, body_vertices, 3] */
  const uint32_t* body_part;  /* [body_vertices] bit p: the vertex belongs to part p; parts may overlap. A cloth vertex
                                 touches each part by itself, so crossing legs do not swallow what is between them */
  const uint32_t* cloth_part; /* [vertices] bit p: the cloth vertex touches part p; NULL: every vertex touches every part */
  const float* hips;          /* [frames, 3, 4] rotation | position of the joint that carries the air and the origin */
  float yoke;                 /* m along the cloth from the nearest pin: within it a vertex stays below that pin, as the
                                 hips stand, so that a stiff skirt does not flip up at its waistband for good; 0: none */
  cloth_solver_settings settings;
} cloth_solver_problem;

/* Simulates every frame, frame 0 being the start, into out [frames, vertices, 3]. Returns the number of frames done: less
 * than `frames` when a coordinate stopped being finite or left a 100 m cube, 0 for a malformed problem. */
int32_t cloth_solver_run(const cloth_solver_problem* problem, float* out);

#ifdef __cplusplus
}
#endif
#endif
