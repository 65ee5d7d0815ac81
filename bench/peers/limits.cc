// What one core can do at most: bytes read from memory and float32 multiply-adds a second.
#include <cstddef>
#include <vector>

#include "bench/kernels/fma_loop.h"
#include "bench/peers/engine.h"
#include "tools/timing.h"

namespace {

using dcloth::tools::NowNanoseconds;

// Pieces far shorter than a scheduler's slice, so that a busy machine interrupts few of them.
constexpr int kReadPasses = 5;
constexpr size_t kPiece = (1u << 20) / sizeof(uint64_t);

volatile uint64_t sink;

// Sixteen sums, which fit registers: loads are independent and additions never wait.
uint64_t Sum(const uint64_t* data, size_t count) {
  constexpr size_t kLanes = 16;
  uint64_t lanes[kLanes] = {};
  for (size_t i = 0; i + kLanes <= count; i += kLanes) {
    for (size_t lane = 0; lane < kLanes; ++lane) lanes[lane] += data[i + lane];
  }
  uint64_t sum = 0;
  for (uint64_t lane : lanes) sum += lane;
  return sum;
}

}  // namespace

double peers_read_rate(uint64_t bytes) {
  const std::vector<uint64_t> data(bytes / sizeof(uint64_t), 1);
  std::vector<double> rates;
  for (int pass = 0; pass < kReadPasses; ++pass) {
    for (size_t at = 0; at + kPiece <= data.size(); at += kPiece) {
      const uint64_t start = NowNanoseconds();
      sink = Sum(data.data() + at, kPiece);
      const auto spent = static_cast<double>(NowNanoseconds() - start);
      rates.push_back(static_cast<double>(kPiece * sizeof(uint64_t)) / spent);
    }
  }
  return dcloth::tools::PercentilesOf(rates).p50;
}

double peers_fma_rate(uint32_t bits) { return dcloth::kernels::MultiplyAddRate(bits); }
