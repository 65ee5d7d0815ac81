/* Stage 3's graph-recurrent layers and embedding over a window of ticks, and their gradient: truncated back-propagation
 * through time for training, called from Python (dcloth_training/mesh_bptt.py).
 *
 * Eight clips run side by side, one a SIMD lane: every array over the mesh has the lane as its last, fastest axis, so
 * each operation is one vector operation and a neighbour's row is contiguous. The network is NETWORK.md's with W^p and
 * b folded into the gates by the caller (m is the mean over N(i) of the layer's input):
 *   z = s(m V_z + c_z + h U_z), r = s(m V_r + c_r + h U_r), g = tanh(m V_g + c_g + (r*h) U_g), h' = h + z*(g - h),
 *   x' = PReLU(LayerNorm(h' W_o + b_o)), and after the last layer s_i = x'_i . e + e_0.
 *
 * Weights are one flat array. A layer: V_z V_r V_g [inputs, width], c_z c_r c_g [width], U_z U_r U_g W_o [width,
 * width], b_o, LayerNorm's scale and shift [width], PReLU's slope [1]; inputs is 3 in the first layer, width in the
 * others. Then e [width] and e_0 [1].
 *
 * Arrays with lanes lie on 64-byte boundaries.
 *
 * _f32 trains, _f64 checks it. One thread, fixed order: the same input gives the same bits. Memory: all lent by the
 * caller. Cost, F = 8, three layers, 7,952 vertices: 2.8 ms a tick and lane with gradient on one core (PyTorch: 27). */
#ifndef DCLOTH_TRAINING_MESH_BPTT_H_
#define DCLOTH_TRAINING_MESH_BPTT_H_

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

enum { MESH_BPTT_LANES = 8 };

typedef struct mesh_bptt_shape {
  int32_t vertices, ticks, layers;
  int32_t width;          /* F: 4, 8, 16 or 32 */
  const int32_t* start;   /* [vertices + 1] N(i) is column[start[i] .. start[i + 1]); j in N(i) where i in N(j) */
  const int32_t* column;  /* [start[vertices]] */
} mesh_bptt_shape;

/* Elements of what the caller lends or reads; 0 for a shape that is not possible (graph not looked at). */
int64_t mesh_bptt_weights_size(const mesh_bptt_shape* shape);
int64_t mesh_bptt_states_size(const mesh_bptt_shape* shape);
int64_t mesh_bptt_tape_size(const mesh_bptt_shape* shape);
int64_t mesh_bptt_scratch_size(const mesh_bptt_shape* shape);

/* mean, back: [start[vertices]] e_ij and e_ji beside each column[]. input [ticks, vertices, 3, lanes] standardised body
 * points. states [layers, vertices, width, lanes]: before the first tick in, after the last one out. out [ticks,
 * vertices, lanes] s. tape: what the gradient needs, written; NULL: no gradient will be asked for.
 * Returns 1, or 0 with nothing written for a shape that is not possible or an array with lanes off its boundary. */
int32_t mesh_bptt_forward_f32(const mesh_bptt_shape* shape, const float* mean, const float* weights, const float* input,
                              float* states, float* tape, float* scratch, float* out);
int32_t mesh_bptt_forward_f64(const mesh_bptt_shape* shape, const double* mean, const double* weights,
                              const double* input, double* states, double* tape, double* scratch, double* out);

/* Gradient of sum(out * out_gradient) by every weight, as doubles: sums over a pass of the mesh are taken in the lanes'
 * type, sums over ticks and lanes in double. No gradient by the input or by the first state: truncation ends there. */
int32_t mesh_bptt_backward_f32(const mesh_bptt_shape* shape, const float* back, const float* weights, const float* tape,
                               const float* out_gradient, float* scratch, double* weights_gradient);
int32_t mesh_bptt_backward_f64(const mesh_bptt_shape* shape, const double* back, const double* weights,
                               const double* tape, const double* out_gradient, double* scratch,
                               double* weights_gradient);

#ifdef __cplusplus
}
#endif
#endif
