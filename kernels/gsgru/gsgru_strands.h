// The layer of the "reproducible" table where no 128-bit vectors are.
#ifndef DCLOTH_KERNELS_GSGRU_GSGRU_STRANDS_H_
#define DCLOTH_KERNELS_GSGRU_GSGRU_STRANDS_H_

#include "kernels/gsgru/gsgru.h"

namespace dcloth::kernels::strands {

// Gsgru of gsgru.h with the bits of four-lane vectors.
void Gsgru(const GsgruJob& job);

}  // namespace dcloth::kernels::strands

#endif  // DCLOTH_KERNELS_GSGRU_GSGRU_STRANDS_H_
