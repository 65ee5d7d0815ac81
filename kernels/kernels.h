// The kernels of one instruction set as a table, and the choice of the table for this CPU.
//
// Every entry is `void f(const <Kernel>Job& job)`; the contract of each job is in its family's header. No kernel
// allocates, fails, keeps state or touches the floating-point environment. Any thread may call any entry.
#ifndef DCLOTH_KERNELS_KERNELS_H_
#define DCLOTH_KERNELS_KERNELS_H_

#include <cstddef>

#include "kernels/kernel_list.h"

namespace dcloth::kernels {

struct KernelTable {
  const char* name;  // "scalar", "sse4", "avx2", "avx3", "neon", "wasm" or "reproducible"
  // Whether subnormal numbers are worth what IEEE 754 says, as they are where nothing can flush them (WebAssembly):
  // "reproducible" alone. The others' callers take them for zero, see engine/src/base/arithmetic.h.
  bool counts_subnormals;
#define DCLOTH_KERNEL_MEMBER(Function, member) void (*member)(const Function##Job& job);
  DCLOTH_KERNEL_LIST(DCLOTH_KERNEL_MEMBER)
#undef DCLOTH_KERNEL_MEMBER
};

// The fastest table this CPU runs; never null. The CPU is asked once.
const KernelTable* BestKernels();

// The table of that name, or null where the build or this CPU lacks it.
const KernelTable* FindKernels(const char* name);

// The tables this CPU runs, best first; "reproducible", which only an x86 CPU before SSE4.2 lacks, and "scalar" are the
// last two. "reproducible" gives the same bits on every CPU.
size_t KernelTableCount();
const KernelTable* KernelTableAt(size_t index);

// The plain reference, frozen: no vector code, the oracle of the converter.
namespace scalar {
DCLOTH_KERNEL_LIST(DCLOTH_DECLARE_KERNEL)
}  // namespace scalar

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_KERNELS_H_
