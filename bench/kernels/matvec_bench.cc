// Dense layers at batch 1: every one of the bundled skirt's (n 7,952) and of the paper-size network's (n 7,964), and
// 400 x 23,900, the size of the prototypes; the best instruction sets, and XNNPACK where the build found it, in turn.
//
//   bench_matvec            all of them (minutes)
//   bench_matvec paper f32  those whose name has one of the words
//
// The limit is the fastest of five ways to read as many bytes. "gru_step" is both products of the recurrent unit and
// its gates. Rejected: no prefetch, 0.57 ms for the prototype's int8 on Zen 3, cold, against 0.43; group-wise scales (a
// multiply per group and column instead of one per column); 4-bit weights (0.34 ms, ten times the error); XNNPACK
// (kernels/README.md).
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "bench/kernels/contest.h"
#include "bench/kernels/dense_problem.h"
#include "bench/kernels/read_limit.h"
#ifdef DCLOTH_BENCH_XNNPACK
#include "bench/kernels/xnnpack_dense.h"
#endif

namespace dcloth::kernels {
namespace {

// Products that a step needs one after the other; with two, the gates of a recurrent unit after them.
using Layers = std::vector<DenseProblem>;

struct Gates {
  AlignedArray<float> h;
  size_t k;

  explicit Gates(size_t units) : h(units), k(units) {}
  void Run(const KernelTable& table, const float* gx, const float* gh) { table.gru_gates({gx, gh, h.data(), k}); }
};

constexpr size_t kPlacements = 4;

// The outputs of one placement's products are compared, then its call is one of the contestant's. `run(p)` is product p
// and `y(p)` its output.
template <typename RunProduct, typename Output>
void AddPlacement(const Layers& layers, WeightKind kind, const KernelTable& gate_table, RunProduct run, Output y,
                  Contestant* contestant) {
  const size_t products = layers.size();
  for (size_t p = 0; p < products; ++p) {
    run(p);
    contestant->error = std::max(contestant->error, layers[p].Error(y(p)));
    contestant->bound = std::max(contestant->bound, layers[p].ErrorBound(kind));
  }
  const auto gates = std::make_shared<Gates>(layers[0].columns / 3);
  contestant->calls.push_back([=, &gate_table] {
    for (size_t p = 0; p < products; ++p) run(p);
    if (products == 2) gates->Run(gate_table, y(0), y(1));
  });
}

#ifdef DCLOTH_BENCH_XNNPACK
struct Peer {
  std::vector<float> y;
  XnnpackDense dense;
  explicit Peer(const DenseProblem& p)
      : y(p.columns), dense(p.matrix.data(), p.rows, p.columns, 1, p.x.data(), y.data()) {}
};
#endif

void Run(const std::string& name, const Layers& layers, WeightKind kind) {
  std::vector<Contestant> contestants, limits(std::size(kReadOrders));
  for (const KernelTable* table : BestTables()) contestants.push_back({table->name, {}});
#ifdef DCLOTH_BENCH_XNNPACK
  Contestant xnnpack{"xnnpack", {}};
#endif
  Work work = {name, 0, 0};
  for (size_t placement = 0; placement < kPlacements; ++placement) {
    std::vector<std::shared_ptr<PackedDense>> packed;
    for (const DenseProblem& problem : layers) packed.push_back(std::make_shared<PackedDense>(problem, kind));
    for (size_t t = 0; t < contestants.size(); ++t) {
      const KernelTable* table = BestTables()[t];
      AddPlacement(
          layers, kind, *table, [=](size_t p) { packed[p]->Run(*table); }, [=](size_t p) { return packed[p]->y(); },
          &contestants[t]);
    }
#ifdef DCLOTH_BENCH_XNNPACK
    if (kind == WeightKind::kF32) {
      std::vector<std::shared_ptr<Peer>> peers;
      for (const DenseProblem& problem : layers) peers.push_back(std::make_shared<Peer>(problem));
      AddPlacement(
          layers, kind, *BestKernels(), [=](size_t p) { peers[p]->dense.Run(); },
          [=](size_t p) { return static_cast<const float*>(peers[p]->y.data()); }, &xnnpack);
    }
#endif
    for (size_t i = 0; i < limits.size(); ++i) {  // the kernels' own weights
      limits[i].calls.push_back([=] {
        for (const auto& p : packed) benchmark::DoNotOptimize(ReadAll(p->weights(), p->weight_bytes(), kReadOrders[i]));
      });
    }
    work.bytes = work.multiply_adds = 0;
    for (size_t p = 0; p < layers.size(); ++p) {
      work.bytes += static_cast<double>(packed[p]->weight_bytes());
      work.multiply_adds += static_cast<double>(layers[p].rows * layers[p].columns);
    }
  }
#ifdef DCLOTH_BENCH_XNNPACK
  if (!xnnpack.calls.empty()) contestants.push_back(std::move(xnnpack));
#endif
  RunContest(work, std::move(contestants), std::move(limits));
}

struct Shape {
  const char* name;
  std::vector<std::pair<size_t, size_t>> products;  // rows, columns
};

const std::vector<Shape> kShapes = {
    {"skirt_static_0", {{49, 256}}},
    {"skirt_static_1", {{256, 18}}},
    {"skirt_gru_step", {{49, 1536}, {512, 1536}}},
    {"skirt_vertex_mlp_0", {{7952, 96}}},
    {"skirt_vertex_mlp_1", {{96, 48}}},
    {"skirt_basis", {{144, 23856}}},
    {"paper_static_0", {{468, 256}}},
    {"paper_static_1", {{256, 72}}},
    {"paper_gru_step", {{468, 1152}, {384, 1152}}},
    {"paper_vertex_mlp_0", {{7964, 1024}}},
    {"paper_vertex_mlp_1", {{1024, 384}}},
    {"paper_basis", {{768, 23892}}},
    {"prototype", {{400, 23900}}},
};

constexpr std::pair<WeightKind, const char*> kKinds[] = {
    {WeightKind::kF32, "f32"}, {WeightKind::kF16, "f16"}, {WeightKind::kI8, "i8"}};

std::vector<Contest> Contests() {
  std::vector<Contest> contests;
  for (const Shape& shape : kShapes) {
    for (const auto& [kind, label] : kKinds) {
      const auto run = [&shape, weights = kind](const std::string& name) {
        std::vector<DenseProblem> problems;
        for (const auto& [rows, columns] : shape.products) problems.emplace_back(rows, columns);
        Run(name, problems, weights);
      };
      contests.push_back({std::string(shape.name) + "/" + label, run});
    }
  }
  return contests;
}

}  // namespace
}  // namespace dcloth::kernels

int main(int argc, char** argv) {
  const int status = dcloth::kernels::RunContests(argc, argv, dcloth::kernels::Contests());
#ifdef DCLOTH_BENCH_XNNPACK
  const auto memory = dcloth::kernels::XnnpackDense::Memory();
  if (memory.allocations == 0) return status;
  std::printf("xnnpack asked for memory %zu times, %.1f MB in all, %zu times in runs\n", memory.allocations,
              static_cast<double>(memory.bytes) * 1e-6, memory.allocations_in_runs);
#endif
  return status;
}
