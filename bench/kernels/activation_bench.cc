// The activations over an array in L1, and a GRU's gates of k 384. Peer: libm's tanhf, 19.6 ns an element.
#include <algorithm>
#include <cmath>

#include "bench/kernels/kernel_bench.h"

namespace dcloth::kernels {
namespace {

constexpr size_t kCount = 2048;

void RunTanh(benchmark::State& state, const KernelTable& table, bool cold) {
  auto x = RandomFloats(kCount, -6, 6);
  AlignedArray<float> y(kCount);
  const TanhJob job = {x.data(), y.data(), kCount};
  table.tanh(job);
  double error = 0;
  for (size_t i = 0; i < kCount; ++i) error = std::max(error, std::fabs(y[i] - std::tanh(double{x[i]})));
  Measure(state, cold, 8.0 * kCount, 0, error, [&] { table.tanh(job); });
}

void RunSigmoid(benchmark::State& state, const KernelTable& table, bool cold) {
  auto x = RandomFloats(kCount, -6, 6);
  AlignedArray<float> y(kCount);
  const SigmoidJob job = {x.data(), y.data(), kCount};
  table.sigmoid(job);
  double error = 0;
  for (size_t i = 0; i < kCount; ++i) error = std::max(error, std::fabs(y[i] - 1 / (1 + std::exp(-double{x[i]}))));
  Measure(state, cold, 8.0 * kCount, 0, error, [&] { table.sigmoid(job); });
}

void RunGru(benchmark::State& state, const KernelTable& table, bool cold) {
  constexpr size_t k = 384;
  auto gx = RandomFloats(3 * k, -2, 2), gh = RandomFloats(3 * k, -2, 2);
  AlignedArray<float> h(k), reference(k);
  table.gru_gates({gx.data(), gh.data(), h.data(), k});
  scalar::GruGates({gx.data(), gh.data(), reference.data(), k});
  double error = 0;
  for (size_t i = 0; i < k; ++i) error = std::max(error, std::fabs(double{h[i]} - reference[i]));
  Measure(state, cold, 32.0 * k, 0, error, [&] { table.gru_gates({gx.data(), gh.data(), h.data(), k}); });
}

const bool kRegistered = [] {
  ForEveryTable("tanh/2048", RunTanh);
  ForEveryTable("sigmoid/2048", RunSigmoid);
  ForEveryTable("gru_gates/k384", RunGru);
  return true;
}();

}  // namespace
}  // namespace dcloth::kernels
