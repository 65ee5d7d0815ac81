// What this CPU and its operating system run, as bits; cpu.cc asks them. No cost beyond the first call.
#ifndef DCLOTH_KERNELS_CPU_H_
#define DCLOTH_KERNELS_CPU_H_

#include <cstdint>

namespace dcloth::kernels {

constexpr uint32_t kCpuScalar = 1u << 0;
constexpr uint32_t kCpuSse4 = 1u << 1;  // SSSE3, SSE4.1, SSE4.2
constexpr uint32_t kCpuAvx2 = 1u << 2;  // and FMA, F16C, BMI1, BMI2; the system saves YMM
// And AVX-512 F, VL, DQ, BW, VNNI; the system saves ZMM. VBMI2 too, which no kernel uses: it tells CPUs from Ice Lake
// and Zen 4 on from earlier ones, which lower their clock for 512-bit vectors, the host's code included.
constexpr uint32_t kCpuAvx3 = 1u << 3;
constexpr uint32_t kCpuNeon = 1u << 4;
constexpr uint32_t kCpuWasm = 1u << 5;  // SIMD128; a module with it does not load elsewhere

uint32_t CpuFeatures();

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_CPU_H_
