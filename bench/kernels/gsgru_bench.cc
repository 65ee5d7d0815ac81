// One graph-recurrent layer over a ring mesh of 6 neighbours (the skirt's topology), at the skirt's and the paper's size.
// Goals on Zen 3 at 7,964 vertices: F 8 0.35 ms, F 16 0.7 ms, F 32 1.8 ms.
#include <algorithm>
#include <cmath>
#include <vector>

#include "bench/kernels/kernel_bench.h"

namespace dcloth::kernels {
namespace {

// Rows of `around` vertices, each vertex joined to its two row neighbours and two in each adjacent row.
struct RingMesh {
  AlignedArray<uint32_t> row_starts;
  AlignedArray<uint16_t> columns;

  RingMesh(size_t vertices, size_t around) : row_starts(vertices + 1), columns(7 * vertices) {
    size_t edges = 0;
    const auto add = [&](size_t vertex) { columns[edges++] = static_cast<uint16_t>(vertex); };
    for (size_t i = 0; i < vertices; ++i) {
      row_starts[i] = static_cast<uint32_t>(edges);
      const size_t row = i / around * around;
      const size_t right = std::min(row + (i - row + 1) % around, vertices - 1);
      const size_t left = std::min(row + (i - row + around - 1) % around, vertices - 1);
      add(i), add(right), add(left);
      if (i >= around) add(i - around), add(left >= around ? left - around : left);
      if (i + around < vertices) add(i + around), add(std::min(right + around, vertices - 1));
    }
    row_starts[vertices] = static_cast<uint32_t>(edges);
  }
};

void Run(benchmark::State& state, const KernelTable& table, bool cold, size_t n, size_t F, size_t w, bool embed) {
  RingMesh mesh(n, 142);
  const float size = 1.0f / std::sqrt(static_cast<float>(F));
  auto x = RandomFloats(n * GsgruInputStride(w), -1, 1);
  auto input_gates = RandomFloats(w * 3 * F, -size, size, 2), gate_bias = RandomFloats(3 * F, -size, size, 3),
       hidden_gates = RandomFloats(2 * F * F, -size, size, 4), candidate = RandomFloats(F * F, -size, size, 5),
       output = RandomFloats(F * F, -size, size, 6), row = RandomFloats(F, -size, size, 7);
  AlignedArray<float> h(GsgruStateFloats(n, F)), next(n * F), s(n), scratch(GsgruScratchFloats(F));
  GsgruJob job = {x.data(), mesh.row_starts.data(), mesh.columns.data(), input_gates.data(), gate_bias.data(),
                  hidden_gates.data(), candidate.data(), output.data(), row.data(), row.data(), row.data(),
                  embed ? row.data() : nullptr, h.data(), embed ? nullptr : next.data(), embed ? s.data() : nullptr,
                  scratch.data(), n, w, F, 0.25f, 0.0f};
  // Error of one step from the reset state, against the scalar reference (which the tests hold to double).
  table.gsgru(job);
  AlignedArray<float> reference(h.size());
  GsgruJob scalar_job = job;
  scalar_job.state = reference.data();
  scalar::Gsgru(scalar_job);
  double error = 0;
  for (size_t i = 0; i < n * F; ++i) error = std::max(error, std::fabs(double{h[i]} - reference[i]));

  const double products = static_cast<double>(n * F) * (3.0 * static_cast<double>(w) + 4.0 * static_cast<double>(F));
  const double bytes = 4.0 * static_cast<double>(x.size() + 2 * h.size() + (embed ? n : n * F)) +
                       2.0 * static_cast<double>(mesh.columns.size());
  Measure(state, cold, bytes, 2 * products, error, [&] { table.gsgru(job); });
}

const bool kRegistered = [] {
  for (const size_t n : {size_t{7952}, size_t{7964}}) {
    for (const size_t F : {size_t{8}, size_t{16}, size_t{32}, size_t{64}}) {
      if (n == 7952 && F == 64) continue;
      const std::string name = "gsgru/n" + std::to_string(n) + "/F" + std::to_string(F);
      ForEveryTable(name + "/hidden", [=](auto& state, auto& table, bool cold) { Run(state, table, cold, n, F, F, false); });
      if (n != 7964) continue;
      ForEveryTable(name + "/first", [=](auto& state, auto& table, bool cold) { Run(state, table, cold, n, F, 3, false); });
      ForEveryTable(name + "/embed", [=](auto& state, auto& table, bool cold) { Run(state, table, cold, n, F, F, true); });
    }
  }
  return true;
}();

}  // namespace
}  // namespace dcloth::kernels
