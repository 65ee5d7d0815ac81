// The layers of the "reproducible" table where no 128-bit vectors are.
#ifndef DCLOTH_KERNELS_GSGRU_GSGRU_STRANDS_H_
#define DCLOTH_KERNELS_GSGRU_GSGRU_STRANDS_H_

#include "kernels/gsgru/gsgru_i8.h"

namespace dcloth::kernels::strands {

// Gsgru of gsgru.h and GsgruI8 of gsgru_i8.h with the bits of four-lane vectors.
void Gsgru(const GsgruJob& job);
void GsgruI8(const GsgruI8Job& job);

}  // namespace dcloth::kernels::strands

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_STRANDS_H_
