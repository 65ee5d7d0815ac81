// Asks for memory before it is read: a request, which never faults and changes no result.
#ifndef DCLOTH_KERNELS_PREFETCH_H_
#define DCLOTH_KERNELS_PREFETCH_H_

#include <cstddef>

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

// Into L2, line by line. Always inline: GCC takes a function that only prefetches for one without effect and drops calls.
DCLOTH_PREFETCH_INLINE void PrefetchBytes(const void* begin, size_t size) {
  constexpr size_t kLine = 64;
  const auto* bytes = static_cast<const char*>(begin);
  for (size_t i = 0; i < size; i += kLine) DCLOTH_PREFETCH(bytes + i);
}

}  // namespace dcloth::kernels

#endif  // DCLOTH_KERNELS_PREFETCH_H_
