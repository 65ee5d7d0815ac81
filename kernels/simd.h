// Settings for Highway that every vector source shares. Include it before any Highway header.
//
// Highway is used header-only: its own dispatch and its abort live in a library that a game should not have to link.
// dispatch.cc chooses the instruction set instead.
#ifndef DCLOTH_KERNELS_SIMD_H_
#define DCLOTH_KERNELS_SIMD_H_

// A release library never aborts, and debug checks would call hwy::Abort.
#define HWY_IS_DEBUG_BUILD 0
// No kernel uses AES, and small Arm cores (Cortex-A72 of the Raspberry Pi 4) lack it.
#define HWY_DISABLE_PCLMUL_AES
#if defined(__aarch64__) || defined(__arm__)
// NEON is the baseline: no target pragma, which would ask for "+crypto".
#define TOOLCHAIN_MISS_SYS_AUXV_H
#endif

// SSSE3 alone is not worth its code; AVX-512 may be left out (DCLOTH_AVX512); AVX3_DL asks for what Ice Lake lacks; SVE
// and RVV are scalable, and the kernels keep arrays of vectors.
#if defined(DCLOTH_AVX512)
#define DCLOTH_DISABLED_AVX3 0
#else
#define DCLOTH_DISABLED_AVX3 HWY_AVX3
#endif
#define HWY_DISABLED_TARGETS                                                                                    \
  (HWY_SSSE3 | DCLOTH_DISABLED_AVX3 | HWY_AVX3_DL | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128 | HWY_RVV | \
   HWY_PPC8 | HWY_WASM_EMU256)

#if defined(DCLOTH_SPLIT_MULTIPLY_ADD)
#define N_NEON N_NEON_SPLIT  // Highway's namespace in these sources, and theirs
#endif

#include "hwy/detect_targets.h"

// Highway always offers a fallback without vectors; the scalar reference takes its place.
#define DCLOTH_VECTOR_TARGET (HWY_TARGET != HWY_SCALAR && HWY_TARGET != HWY_EMU128)

#endif  // DCLOTH_KERNELS_SIMD_H_
