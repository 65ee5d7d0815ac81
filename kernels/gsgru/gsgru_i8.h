// The layer of gsgru.h with its products in integers: int8 weights times inputs rounded to 16 bits, summed exactly.
//   m, h, r h and h' are rounded before they enter a product: m to steps of its feature, the others, which stay within
//   +-1, to steps of 1/32767. State, gates, layer norm and what passes between layers stay float. NEON, whose integers
//   are no faster, multiplies the same weights as floats, its inputs not rounded.
// Rounded to 8 bits a layer of F 32 takes a tenth less with AVX-512, but in a held pose its state never rests: levels
// near a rounding's edge keep each other changing (0.10 mm a tick on a network of the paper's size, where 16 bits leave
// 0.004). The first layer's three inputs per vertex keep their f32 weights.
#ifndef DCLOTH_KERNELS_GSGRU_GSGRU_I8_H_
#define DCLOTH_KERNELS_GSGRU_GSGRU_I8_H_

#include "kernels/gsgru/gsgru.h"

namespace dcloth::kernels {

constexpr float kGsgruHiddenLevels = 32767.0f;  // of h, r h and h'

// Floats of scratch that a call needs: float tiles, 16-bit tiles, the weights as the instruction set wants them.
constexpr size_t GsgruI8ScratchFloats(size_t features) {
  return GsgruScratchFloats(features) + kGsgruBlock * 3 * features / 2 + 7 * features * features;
}

// Columns of the weights: input gates z, r, candidate (not with width 3), hidden gates z, r, candidate, output, F each.
constexpr size_t GsgruI8Columns(size_t input_width, size_t features) { return (input_width == 3 ? 4 : 7) * features; }

// A sum of integer products times its column's scale is what the product adds to a gate (or o): the scale holds the
// step of the inputs too. All start on 64 bytes.
struct GsgruI8Job {
  GsgruJob layer;  // hidden_gates, hidden_candidate and output are not read, input_gates with input_width 3 alone;
                   // scratch is [GsgruI8ScratchFloats(F)]
  const int8_t* weights;             // [F, GsgruI8Columns] flat, -127 to 127
  const float* column_scales;        // [GsgruI8Columns]
  const float* input_inverse_steps;  // [F]: q = saturated round(m * this); not read with input_width 3
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_I8_H_
