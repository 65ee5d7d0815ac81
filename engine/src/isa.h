// Which kernels the process runs: the CPU's best unless the host has chosen others.
#ifndef DCLOTH_ENGINE_SRC_ISA_H_
#define DCLOTH_ENGINE_SRC_ISA_H_

#include "engine/src/float_environment.h"
#include "kernels/kernels.h"

namespace dcloth::engine {

const kernels::KernelTable& ActiveKernels();

// What those kernels are to compute in.
inline Subnormals ActiveSubnormals() {
  return ActiveKernels().counts_subnormals ? Subnormals::kCount : Subnormals::kAreZero;
}

// Null chooses the best. False, and nothing changes, where the CPU or the build lacks `name`.
bool SelectKernels(const char* name);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_ISA_H_
