// The engine as the bench's Python drives it, beside peers of its own process: C functions for ctypes.
//
// One call is one tick and one drawn frame, timed inside: features, three stages, displacement, then skinning and
// normals. Handles belong to the thread that opened them and live until the process ends.
#ifndef DCLOTH_BENCH_PEERS_ENGINE_H_
#define DCLOTH_BENCH_PEERS_ENGINE_H_

#include <stdint.h>

#define PEERS_API extern "C" __attribute__((visibility("default")))

// DCLOTH_STEP_COUNT step times and the whole, ns; `whole` is more than the sum by the clock's and the calls' own cost.
struct PeersTimes {
  uint64_t steps[8];
  uint64_t whole;
};

// What the last call that failed said; never null.
PEERS_API const char* peers_error();

// A model and the sequence it plays. Null on failure.
PEERS_API void* peers_open(const char* model, const char* sequence);
PEERS_API uint64_t peers_model_bytes(void* engine);
PEERS_API uint64_t peers_instance_bytes(void* engine);
PEERS_API const char* peers_isa();

// Milliseconds of each of `count` calls of dcloth_model_open on one file's bytes, with emptied caches where `cold` is
// not 0. 0 on success.
PEERS_API int peers_open_times(const char* model, int cold, uint32_t count, double* ms);

// 0 on success.
PEERS_API int peers_reset(void* engine);
PEERS_API int peers_tick(void* engine, uint32_t frame, PeersTimes* times);

// [n, 3] of the last tick, metres.
PEERS_API const float* peers_positions(void* engine, uint32_t* vertex_count);

// Empties the caches as `dcloth profile --cold` does.
PEERS_API void peers_evict();
PEERS_API uint64_t peers_evicted_bytes();

// Limits of the core this runs on. Read: GB/s over `bytes` of memory, more than the caches hold, at least 1 MB: the
// median of its pieces of 1 MB in several passes. FMA: 1e9 float32 multiply-adds a second in vectors of `bits` 256 or
// 512, best of several passes; 0 where the CPU has none or is no x86-64.
PEERS_API double peers_read_rate(uint64_t bytes);
PEERS_API double peers_fma_rate(uint32_t bits);

#endif  // DCLOTH_BENCH_PEERS_ENGINE_H_
