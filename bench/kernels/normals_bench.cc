// Vertex normals of a ring mesh at the skirt's size: 142 columns by 56 rows.
#include <cmath>

#include "bench/kernels/kernel_bench.h"

namespace dcloth::kernels {
namespace {

void Run(benchmark::State& state, const KernelTable& table, bool cold) {
  constexpr size_t kAround = 142, kRows = 56, kVertices = kAround * kRows, kTriangles = 2 * kAround * (kRows - 1);
  AlignedArray<uint16_t> triangles(3 * kTriangles);
  size_t at = 0;
  for (size_t row = 0; row + 1 < kRows; ++row) {
    for (size_t i = 0; i < kAround; ++i) {
      const size_t a = row * kAround + i, b = row * kAround + (i + 1) % kAround;
      for (const size_t corner : {a, b, a + kAround, b, b + kAround, a + kAround}) {
        triangles[at++] = static_cast<uint16_t>(corner);
      }
    }
  }
  auto positions = RandomFloats(3 * kVertices, -1, 1);
  AlignedArray<float> normals(3 * kVertices), reference(3 * kVertices);
  scalar::Normals({positions.data(), 12, triangles.data(), reference.data(), 12, kVertices, kTriangles});
  const NormalsJob job = {positions.data(), 12, triangles.data(), normals.data(), 12, kVertices, kTriangles};
  table.normals(job);
  double error = 0;
  for (size_t i = 0; i < normals.size(); ++i) error = std::max(error, std::fabs(double{normals[i]} - reference[i]));
  Measure(state, cold, 24.0 * kVertices + 6.0 * kTriangles, 0, error, [&] { table.normals(job); });
}

const bool kRegistered = [] {
  ForEveryTable("normals/n7952", [](auto& state, auto& table, bool cold) { Run(state, table, cold); });
  return true;
}();

}  // namespace
}  // namespace dcloth::kernels
