/* The patch stage over a window of ticks, and its gradient through time (engine/format/NETWORK.md, Patch stage).
 *
 * Windows of several clips lie side by side: B streams of K patches are N = B K columns. All matrices of the tape are
 * features by columns. Reals are float or double; the suffix of a function says which.
 *
 * Sizes: J joints, R points a patch, W width, I inputs = 19 R + 33 + E, L mixing layers, S neighbours of a patch in
 * each. A window has T ticks.
 */
#ifndef DCLOTH_TRAINING_PATCH_BPTT_PATCH_BPTT_H_
#define DCLOTH_TRAINING_PATCH_BPTT_PATCH_BPTT_H_

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { PATCH_BPTT_INFLUENCES = 4, PATCH_BPTT_LIMBS = 2, PATCH_BPTT_BONES_A_LIMB = 2 };

typedef struct patch_bptt_shape {
  int32_t streams, ticks, joints;
  int32_t patches, points, width, embedding, layers, neighbours; /* K, R, W, E, L, S */
  const int32_t* patch_joint;                                    /* [K] whose frame a patch has */
  const int32_t* point_joints;                                   /* [K, R, 4] */
  const int32_t* limbs;          /* [K, 2, 2] capsules, the one at the hips or shoulder first */
  const int32_t* capsule_joints; /* [capsules] */
  const int32_t* near;           /* [L, S, K] neighbours; a patch itself where there is none */
} patch_bptt_shape;

/* geometry, one array of reals: patch axes [K, 3, 3] (columns out, up, along), centres [K, 3] m at bind, point parts
 * [K, R, 4, 4] (mean of weight times place, mean weight), capsules [capsules, 8] (ends, radii, m at bind).
 * weights: embed [K, E]; enter [W, I], [W]; L times mix [W, (1 + S) W], [W]; gates of the input [3 W, W] and of the
 * state [3 W, W], [3 W]; out [3 R, W], [3 R]; skip [3 R, I]; keep [R] before the logistic function.
 * poses [B, T + 2, 12 J + 6]: skinning matrices, metres from the hips of that tick; how the hips moved since the tick
 * before; wind, m a tick. The first two are the ticks before the window.
 * last, before [N, 3, R]: displacements one and two ticks ago in the patches' frames, m. hidden [N, W].
 * noise: [T, N, 3, R], added to `last` before each tick reads it, or null.
 * Results: moved [T, N, 3, R]; last, before and hidden advance in place. tape: null, or patch_bptt_tape_size reals. */
int64_t patch_bptt_weights_size(const patch_bptt_shape* shape);
int64_t patch_bptt_tape_size(const patch_bptt_shape* shape);

int32_t patch_bptt_forward_f32(const patch_bptt_shape*, const float* geometry, const float* weights, const float* poses,
                               const float* noise, float* last, float* before, float* hidden, float* tape,
                               float* moved);
int32_t patch_bptt_forward_f64(const patch_bptt_shape*, const double* geometry, const double* weights,
                               const double* poses, const double* noise, double* last, double* before, double* hidden,
                               double* tape, double* moved);
/* gradient [weights_size], of a loss with the gradient by_moved [T, N, 3, R]. */
int32_t patch_bptt_backward_f32(const patch_bptt_shape*, const float* geometry, const float* weights,
                                const float* poses, const float* tape, const float* by_moved, float* gradient);
int32_t patch_bptt_backward_f64(const patch_bptt_shape*, const double* geometry, const double* weights,
                                const double* poses, const double* tape, const double* by_moved, double* gradient);

#ifdef __cplusplus
}
#endif

#endif /* DCLOTH_TRAINING_PATCH_BPTT_PATCH_BPTT_H_ */
