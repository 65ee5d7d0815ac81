#include "kernels/cpu.h"

#include <atomic>

#if defined(__x86_64__) || defined(__i386__) || defined(_M_X64) || defined(_M_IX86)
#define DCLOTH_CPU_X86 1
#if defined(_MSC_VER)
#include <intrin.h>
#else
#include <cpuid.h>
#endif
#else
#define DCLOTH_CPU_X86 0
#endif

namespace dcloth::kernels {
namespace {

#if DCLOTH_CPU_X86

struct CpuidResult {
  uint32_t eax, ebx, ecx, edx;
};

CpuidResult Cpuid(uint32_t leaf) {
  CpuidResult result = {0, 0, 0, 0};
#if defined(_MSC_VER)
  int words[4];
  __cpuidex(words, static_cast<int>(leaf), 0);
  result = {static_cast<uint32_t>(words[0]), static_cast<uint32_t>(words[1]), static_cast<uint32_t>(words[2]),
            static_cast<uint32_t>(words[3])};
#else
  __cpuid_count(leaf, 0, result.eax, result.ebx, result.ecx, result.edx);
#endif
  return result;
}

// Register state that the operating system saves. Only where CPUID.1:ECX.OSXSAVE is set.
uint32_t EnabledState() {
#if defined(_MSC_VER)
  return static_cast<uint32_t>(_xgetbv(0));
#else
  uint32_t low, high;
  __asm__ volatile("xgetbv" : "=a"(low), "=d"(high) : "c"(0));
  return low;
#endif
}

constexpr bool HasAll(uint32_t word, uint32_t mask) { return (word & mask) == mask; }
constexpr uint32_t Bit(int index) { return uint32_t{1} << index; }

// Bit numbers: Intel SDM volume 2A, CPUID, leaves 1 and 7.
uint32_t Detect() {
  uint32_t features = kCpuScalar;
  const uint32_t last_leaf = Cpuid(0).eax;
  if (last_leaf < 1) return features;
  const CpuidResult leaf1 = Cpuid(1);
  if (!HasAll(leaf1.ecx, Bit(9) | Bit(19) | Bit(20))) return features;
  features |= kCpuSse4;

  const uint32_t osxsave_avx_fma_f16c = Bit(27) | Bit(28) | Bit(12) | Bit(29);
  if (last_leaf < 7 || !HasAll(leaf1.ecx, osxsave_avx_fma_f16c)) return features;
  const uint32_t state = EnabledState();
  const CpuidResult leaf7 = Cpuid(7);
  const uint32_t avx2_bmi1_bmi2 = Bit(5) | Bit(3) | Bit(8);
  if (!HasAll(state, 0x06) || !HasAll(leaf7.ebx, avx2_bmi1_bmi2)) return features;
  features |= kCpuAvx2;

  const uint32_t f_dq_bw_vl = Bit(16) | Bit(17) | Bit(30) | Bit(31), vbmi2_vnni = Bit(6) | Bit(11);
  if (HasAll(state, 0xE6) && HasAll(leaf7.ebx, f_dq_bw_vl) && HasAll(leaf7.ecx, vbmi2_vnni)) features |= kCpuAvx3;
  return features;
}

#else

uint32_t Detect() {
  uint32_t features = kCpuScalar;
#if defined(__ARM_NEON) || defined(_M_ARM64)
  features |= kCpuNeon;
#endif
#if defined(__wasm_simd128__)
  features |= kCpuWasm;
#endif
  return features;
}

#endif  // DCLOTH_CPU_X86

// Zero means not asked yet. Two threads may ask at once: both store the same word.
std::atomic<uint32_t> g_features{0};

}  // namespace

uint32_t CpuFeatures() {
  uint32_t features = g_features.load(std::memory_order_relaxed);
  if (features == 0) {
    features = Detect();
    g_features.store(features, std::memory_order_relaxed);
  }
  return features;
}

}  // namespace dcloth::kernels
