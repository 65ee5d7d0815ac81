// The one place that knows which instruction sets were compiled and which of them this CPU runs.
#include "kernels/simd.h"

#include "kernels/cpu.h"
#include "kernels/gsgru/gsgru_strands.h"
#include "kernels/kernels.h"

// Highway falls back to emulation in silence where the compiler was not told of SIMD.
#if defined(DCLOTH_WASM_SIMD) && !(HWY_TARGETS & HWY_WASM)
#error "DCLOTH_WASM_SIMD is on, but no WebAssembly SIMD target is compiled: -msimd128 is missing"
#endif

// Each release of Highway may name its targets anew: what is then not compiled would leave the scalar kernels alone.
#if (HWY_ARCH_X86 || HWY_ARCH_ARM_A64) && !(HWY_TARGETS & (HWY_AVX3 | HWY_AVX2 | HWY_SSE4 | HWY_NEON))
#error "Highway compiles none of AVX3, AVX2, SSE4 and NEON here: dcloth knows the names of Highway 1.0.3 to 1.0.5"
#endif
#if HWY_ARCH_ARM_A64 && defined(HWY_NEON_WITHOUT_AES)
#error "Highway 1.0.6 and later has two NEON targets, of which dcloth's settings choose the one it does not list"
#endif

namespace dcloth::kernels {
namespace {

constexpr char kReproducible[] = "reproducible";

constexpr bool SameText(const char* a, const char* b) {
  while (*a != '\0' && *a == *b) ++a, ++b;
  return *a == *b;
}

}  // namespace

#define DCLOTH_KERNEL_ENTRY(Function, member) Function,
// Highway names the namespaces; the vector sources define the functions.
#define DCLOTH_KERNEL_TABLE(space, label)                                                                          \
  namespace space {                                                                                                \
  DCLOTH_KERNEL_LIST(DCLOTH_DECLARE_KERNEL)                                                                        \
  constexpr KernelTable kTable = {label, SameText(label, kReproducible), DCLOTH_KERNEL_LIST(DCLOTH_KERNEL_ENTRY)}; \
  }
// The functions of `of` as the reproducible ones.
#define DCLOTH_KERNEL_ALIAS(of, space)                                                           \
  namespace space {                                                                              \
  using namespace of;                                                                            \
  constexpr KernelTable kTable = {kReproducible, true, DCLOTH_KERNEL_LIST(DCLOTH_KERNEL_ENTRY)}; \
  }

#if HWY_TARGETS & HWY_AVX3
DCLOTH_KERNEL_TABLE(N_AVX3, "avx3")
#endif
#if HWY_TARGETS & HWY_AVX2
DCLOTH_KERNEL_TABLE(N_AVX2, "avx2")
#endif
#if HWY_TARGETS & HWY_SSE4
DCLOTH_KERNEL_TABLE(N_SSE4, "sse4")
#endif
#if HWY_TARGETS & HWY_NEON
DCLOTH_KERNEL_TABLE(N_NEON, "neon")
#endif
#if HWY_TARGETS & HWY_WASM
DCLOTH_KERNEL_TABLE(N_WASM, "wasm")
#endif
DCLOTH_KERNEL_TABLE(scalar, "scalar")
// 128-bit vectors, nothing fused: the same operations in the same order everywhere (multiply_add-inl.h). Where a build
// has none of these, the scalar references, whose bits differ in one kernel alone (gsgru_strands.cc).
#if HWY_TARGETS & HWY_SSE4
DCLOTH_KERNEL_ALIAS(N_SSE4, reproducible)
#elif (HWY_TARGETS & HWY_NEON) && HWY_ARCH_ARM_A64
DCLOTH_KERNEL_TABLE(N_NEON_SPLIT, kReproducible)
#elif HWY_TARGETS & HWY_WASM
DCLOTH_KERNEL_ALIAS(N_WASM, reproducible)
#else
DCLOTH_KERNEL_ALIAS(scalar, strands)
#define DCLOTH_REPRODUCIBLE_IS_SCALAR
#endif

namespace {

struct Choice {
  uint32_t cpu;
  const KernelTable* table;
};

// Best first; the reproducible one and scalar, which every CPU runs, are the last two.
constexpr Choice kChoices[] = {
#if HWY_TARGETS & HWY_AVX3
    {kCpuAvx3, &N_AVX3::kTable},
#endif
#if HWY_TARGETS & HWY_AVX2
    {kCpuAvx2, &N_AVX2::kTable},
#endif
#if HWY_TARGETS & HWY_SSE4
    {kCpuSse4, &N_SSE4::kTable},
#endif
#if HWY_TARGETS & HWY_NEON
    {kCpuNeon, &N_NEON::kTable},
#endif
#if HWY_TARGETS & HWY_WASM
    {kCpuWasm, &N_WASM::kTable},
#endif
#if HWY_TARGETS & HWY_SSE4
    {kCpuSse4, &reproducible::kTable},
#elif (HWY_TARGETS & HWY_NEON) && HWY_ARCH_ARM_A64
    {kCpuNeon, &N_NEON_SPLIT::kTable},
#elif HWY_TARGETS & HWY_WASM
    {kCpuWasm, &reproducible::kTable},
#endif
    {kCpuScalar, &scalar::kTable},
#if defined(DCLOTH_REPRODUCIBLE_IS_SCALAR)
    {kCpuScalar, &strands::kTable},
#endif
};

}  // namespace

size_t KernelTableCount() {
  const uint32_t cpu = CpuFeatures();
  size_t count = 0;
  for (const Choice& choice : kChoices) count += (cpu & choice.cpu) != 0;
  return count;
}

const KernelTable* KernelTableAt(size_t index) {
  const uint32_t cpu = CpuFeatures();
  for (const Choice& choice : kChoices) {
    if ((cpu & choice.cpu) == 0) continue;
    if (index == 0) return choice.table;
    --index;
  }
  return nullptr;
}

const KernelTable* BestKernels() { return KernelTableAt(0); }

const KernelTable* FindKernels(const char* name) {
  if (name == nullptr) return nullptr;
  const uint32_t cpu = CpuFeatures();
  for (const Choice& choice : kChoices) {
    if ((cpu & choice.cpu) != 0 && SameText(choice.table->name, name)) return choice.table;
  }
  return nullptr;
}

}  // namespace dcloth::kernels
