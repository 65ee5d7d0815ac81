// How fast this core reads: the limit of a product that takes each weight once.
#ifndef DCLOTH_BENCH_KERNELS_READ_LIMIT_H_
#define DCLOTH_BENCH_KERNELS_READ_LIMIT_H_

#include <cstddef>
#include <cstdint>

namespace dcloth::kernels {

// Ways to read; no single one is the fastest from every cache and from memory.
struct ReadOrder {
  size_t streams;         // parts of the block read side by side: 1, 2, 4 or 8
  size_t prefetch_bytes;  // how far ahead; 0 for none
};
constexpr ReadOrder kReadOrders[] = {{1, 0}, {1, 1536}, {4, 0}, {8, 0}, {8, 512}};

// Sums the 64-bit words of `bytes` bytes from a 64-byte boundary on; what does not fill 512 bytes is left out.
uint64_t ReadAll(const uint8_t* data, size_t bytes, ReadOrder order);

}  // namespace dcloth::kernels

#endif  // DCLOTH_BENCH_KERNELS_READ_LIMIT_H_
