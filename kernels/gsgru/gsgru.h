// One graph-recurrent layer over the whole mesh (NETWORK.md, "Mesh stage"), with W^p folded into the gates:
//   m_i = mean over j in N(i) of x_j
//   [z | r | c] = m [W^pW^z | W^pW^r | W^pW] + gate_bias; z = s(z + h U^z); r = s(r + h U^r); g = tanh(c + (r h) U)
//   h' = (1 - z) h + z g; o = h' W^o + b^o; next x = PReLU(LayerNorm(o)), eps 1e-5
// The last layer may end in the embedding s_i = (next x_i) . embed + embed_bias instead of writing next x.
#ifndef DCLOTH_KERNELS_GSGRU_GSGRU_H_
#define DCLOTH_KERNELS_GSGRU_GSGRU_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

constexpr size_t kGsgruMaxFeatures = 64;
constexpr float kGsgruEpsilon = 1e-5f;  // of the layer norm
// Vertices that a kernel works on at once; state is padded to a multiple of it.
constexpr size_t kGsgruBlock = 16;

// Floats from one vertex's input row to the next: a width of 3 is stored with stride 4, whose last float is never used
// and may hold anything.
constexpr size_t GsgruInputStride(size_t input_width) { return input_width == 3 ? 4 : input_width; }

// Floats of recurrent state of one layer: [padded vertices, F], the same on every instruction set. Zero is a reset.
constexpr size_t GsgruStateFloats(size_t vertices, size_t features) {
  return (vertices + kGsgruBlock - 1) / kGsgruBlock * kGsgruBlock * features;
}

// Floats of scratch that a call needs; contents neither matter before nor after.
constexpr size_t GsgruScratchFloats(size_t features) { return kGsgruBlock * (4 * features + 4); }

// Weights are flat [in, out] f32 as in MeshLayer of dcloth.fbs. state, scratch, x, next_x and weights start on 64
// bytes. Every vertex has at least one neighbour (itself). Values are finite. next_x and s overlap nothing else. The
// vertices of a job may be a part of the mesh, from a multiple of kGsgruBlock on: all but x and columns start with the
// part.
struct GsgruJob {
  const float* x;                 // [all vertices of the mesh, GsgruInputStride(input_width)]
  const uint32_t* row_starts;     // [vertices + 1]
  const uint16_t* columns;        // [row_starts[vertices]], each a row of x
  const float* input_gates;       // [input_width, 3 F]: z, r, candidate
  const float* gate_bias;         // [3 F]
  const float* hidden_gates;      // [F, 2 F]: z, r
  const float* hidden_candidate;  // [F, F]
  const float* output;            // [F, F]
  const float* output_bias;       // [F]
  const float* norm_gain;         // [F]
  const float* norm_offset;       // [F]
  const float* embed;             // [F], or null
  float* state;                   // [GsgruStateFloats(vertices, F)], updated
  float* next_x;                  // [vertices, F], written unless embed is given (then it may be null)
  float* s;                       // [vertices], written where embed is given (else it may be null)
  float* scratch;                 // [GsgruScratchFloats(F)]
  size_t vertices;
  size_t input_width;  // 3 or F
  size_t features;     // F: a multiple of 8, 8 to 64
  float prelu_slope;
  float embed_bias;
  const void* ahead = nullptr;   // memory read after the job: a layer waits for arithmetic, and each block asks for its
  size_t block_ahead_bytes = 0;  // share of this into L2; any bytes, the values are not looked at. 0: none
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_H_
