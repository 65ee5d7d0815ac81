// Asks for memory before it is read: a request, which never faults and changes no result.
#ifndef DCLOTH_KERNELS_PREFETCH_H_
#define DCLOTH_KERNELS_PREFETCH_H_

#include <cstddef>
#include <cstdint>

#if defined(_MSC_VER) && !defined(__clang__) && (defined(_M_X64) || defined(_M_IX86))
#include <xmmintrin.h>
#define DCLOTH_PREFETCH(address) _mm_prefetch(address, _MM_HINT_T1)
#define DCLOTH_PREFETCH_INLINE __forceinline
#elif defined(__x86_64__) || defined(__i386__) || defined(__aarch64__) || defined(__arm__)
#define DCLOTH_PREFETCH(address) __builtin_prefetch(address, /*rw=*/0, /*locality=*/2)
#define DCLOTH_PREFETCH_INLINE __attribute__((always_inline)) inline
#else
#define DCLOTH_PREFETCH(address) static_cast<void>(address)
#define DCLOTH_PREFETCH_INLINE inline
#endif

namespace dcloth::kernels {

// Into L2, line by line. `begin` is an address, as a pointer may not lie outside of its array. Always inline: GCC takes
// a function that only prefetches for one without effect and drops calls.
DCLOTH_PREFETCH_INLINE void PrefetchBytes(uintptr_t begin, size_t size) {
  constexpr size_t kLine = 64;
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC unroll 1  // a request a cycle is more than memory takes
#endif
  for (uintptr_t line = begin; line < begin + size; line += kLine) {
    DCLOTH_PREFETCH(reinterpret_cast<const char*>(line));
  }
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_PREFETCH_H_
