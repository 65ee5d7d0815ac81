// Bare float32 multiply-adds: the limit of a core's arithmetic.
#ifndef DCLOTH_BENCH_KERNELS_FMA_LOOP_H_
#define DCLOTH_BENCH_KERNELS_FMA_LOOP_H_

#include <cstdint>

namespace dcloth::kernels {

// Runs a loop of some 0.3 ms in vectors of `bits` 256 or 512 and returns how many multiply-adds it was: 0 where the CPU
// has none such or is no x86-64.
double RunMultiplyAdds(uint32_t bits);

// 1e9 multiply-adds a second, best of 200 loops, none of them as long as a scheduler's slice.
double MultiplyAddRate(uint32_t bits);

}  // namespace dcloth::kernels

#endif  // DCLOTH_BENCH_KERNELS_FMA_LOOP_H_
