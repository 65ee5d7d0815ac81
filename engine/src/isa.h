// Which kernels the process runs: the CPU's best unless the host has chosen others.
#ifndef DCLOTH_ENGINE_SRC_ISA_H_
#define DCLOTH_ENGINE_SRC_ISA_H_

#include "kernels/kernels.h"

namespace dcloth::engine {

const kernels::KernelTable& ActiveKernels();

// Null chooses the best. False, and nothing changes, where the CPU or the build lacks `name`.
bool SelectKernels(const char* name);

}  // namespace dcloth::engine

#endif  // DCLOTH_ENGINE_SRC_ISA_H_
