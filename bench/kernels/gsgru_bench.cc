// One graph-recurrent layer over a ring mesh of 6 neighbours (the skirt's topology), at the skirt's and the paper's
// size: the best instruction sets in turn, and XNNPACK, where the build found it, with the layer's products alone.
//
//   bench_gsgru         all of them
//   bench_gsgru F32     those whose name has the word
//
// The limit is what bare multiply-adds in float would take. Errors of the kernels are those of one step to their scalar
// references (which the tests hold to double), of XNNPACK those of its products to double.
// Goals on Zen 3 at 7,964 vertices: F 8 0.35 ms, F 16 0.7 ms, F 32 1.8 ms.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "bench/kernels/contest.h"
#include "bench/kernels/fma_loop.h"
#include "bench/kernels/kernel_bench.h"
#ifdef DCLOTH_BENCH_XNNPACK
#include "bench/kernels/xnnpack_dense.h"
#endif

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

enum class Place { kHidden, kFirst, kEmbed };  // in the stack of layers

// A layer with random weights. Every contestant has a state of its own, so that all take the same steps.
struct Layer {
  size_t n, F, w;
  RingMesh mesh;
  AlignedArray<float> x, input_gates, gate_bias, hidden_gates, candidate, output, row, next, s, scratch, factors;
  AlignedArray<int8_t> integers;  // of the four products, side by side
  AlignedArray<float> steps{0};
  bool embed;

  Layer(size_t vertices, size_t features, Place place)
      : n(vertices),
        F(features),
        w(place == Place::kFirst ? 3 : features),
        mesh(n, 142),
        x(RandomFloats(n * GsgruInputStride(w), -1, 1)),
        input_gates(Weights(w * 3 * F, 2)),
        gate_bias(Weights(3 * F, 3)),
        hidden_gates(Weights(2 * F * F, 4)),
        candidate(Weights(F * F, 5)),
        output(Weights(F * F, 6)),
        row(Weights(F, 7)),
        next(n * F),
        s(n),
        scratch(GsgruI8ScratchFloats(F)),
        factors(7 * F),
        integers(7 * F * F),
        embed(place == Place::kEmbed) {
    AlignedArray<float> levels = RandomFloats(integers.size(), -127, 127, 8);
    for (size_t i = 0; i < integers.size(); ++i) integers[i] = static_cast<int8_t>(std::lround(levels[i]));
    // Weights of the floats' size, for inputs within 1.
    for (size_t i = 0; i < factors.size(); ++i)
      factors[i] = 1.0f / (127.0f * kGsgruHiddenLevels * std::sqrt(static_cast<float>(F)));
    steps = RandomFloats(F, 25000, 32000, 9);
  }

  AlignedArray<float> Weights(size_t count, uint32_t seed) const {
    const float size = 1.0f / std::sqrt(static_cast<float>(F));
    return RandomFloats(count, -size, size, seed);
  }

  GsgruJob Job(float* state) {
    return {x.data(),
            mesh.row_starts.data(),
            mesh.columns.data(),
            input_gates.data(),
            gate_bias.data(),
            hidden_gates.data(),
            candidate.data(),
            output.data(),
            row.data(),
            row.data(),
            row.data(),
            embed ? row.data() : nullptr,
            state,
            embed ? nullptr : next.data(),
            embed ? s.data() : nullptr,
            scratch.data(),
            n,
            w,
            F,
            0.25f,
            0.0f};
  }

  GsgruI8Job IntegerJob(float* state) { return {Job(state), integers.data(), factors.data(), steps.data()}; }

  double Products() const {
    return static_cast<double>(n * F) * (3.0 * static_cast<double>(w) + 4.0 * static_cast<double>(F));
  }
  double Bytes() {
    const size_t floats = x.size() + 2 * GsgruStateFloats(n, F) + (embed ? n : n * F);
    return 4.0 * static_cast<double>(floats) + 2.0 * static_cast<double>(mesh.columns.size());
  }
};

#ifdef DCLOTH_BENCH_XNNPACK
// The layer's four products without neighbours, gates and norm, which XNNPACK has no operator for.
struct XnnpackProducts {
  std::vector<std::vector<float>> inputs, outputs;
  std::vector<XnnpackDense> products;
  double error = 0, bound = 0;

  explicit XnnpackProducts(Layer& layer) {
    const size_t n = layer.n, F = layer.F, w = layer.w;
    const std::pair<size_t, size_t> shapes[] = {{w, 3 * F}, {F, 2 * F}, {F, F}, {F, F}};
    const float* matrices[] = {layer.input_gates.data(), layer.hidden_gates.data(), layer.candidate.data(),
                               layer.output.data()};
    for (size_t p = 0; p < 4; ++p) {
      const auto [rows, columns] = shapes[p];
      AlignedArray<float> input = RandomFloats(n * rows, -1, 1, static_cast<uint32_t>(p));
      inputs.emplace_back(input.data(), input.data() + input.size());
      outputs.emplace_back(n * columns);
      products.emplace_back(matrices[p], rows, columns, n, inputs[p].data(), outputs[p].data());
      products[p].Run();
      Compare(matrices[p], n, rows, columns, p);
    }
  }

  void Compare(const float* matrix, size_t n, size_t rows, size_t columns, size_t p) {
    for (size_t v = 0; v < n; ++v) {
      for (size_t c = 0; c < columns; ++c) {
        double sum = 0, magnitude = 0;
        for (size_t j = 0; j < rows; ++j) {
          const double product = double{inputs[p][v * rows + j]} * matrix[j * columns + c];
          sum += product;
          magnitude += std::fabs(product);
        }
        error = std::max(error, std::fabs(outputs[p][v * columns + c] - sum));
        bound = std::max(bound, static_cast<double>(rows + 1) * 0x1p-24 * magnitude);
      }
    }
  }

  void Run() const {
    for (const XnnpackDense& product : products) product.Run();
  }
};
#endif

// Fused and contracted sums differ in rounding; the tests bound the difference element by element.
constexpr double kScalarDifference = 1e-6;

// Levels of inputs where the floats before them lie between two.
constexpr double kScalarLevels = 1e-4;

double ErrorToScalar(const KernelTable& table, Layer& layer, bool integers) {
  AlignedArray<float> h(GsgruStateFloats(layer.n, layer.F)), reference(h.size());
  if (integers) {
    table.gsgru_i8(layer.IntegerJob(h.data()));
    scalar::GsgruI8(layer.IntegerJob(reference.data()));
  } else {
    table.gsgru(layer.Job(h.data()));
    scalar::Gsgru(layer.Job(reference.data()));
  }
  double error = 0;
  for (size_t i = 0; i < layer.n * layer.F; ++i) error = std::max(error, std::fabs(double{h[i]} - reference[i]));
  return error;
}

void Run(const std::string& name, size_t n, size_t F, Place place) {
  const auto layer = std::make_shared<Layer>(n, F, place);
  std::vector<Contestant> contestants;
  for (const KernelTable* table : BestTables()) {
    const auto state = std::make_shared<AlignedArray<float>>(GsgruStateFloats(n, F));
    const auto integer_state = std::make_shared<AlignedArray<float>>(state->size());
    contestants.push_back({table->name,
                           {[=] { table->gsgru(layer->Job(state->data())); }},
                           ErrorToScalar(*table, *layer, false),
                           kScalarDifference});
    contestants.push_back({table->name + std::string(" int8"),
                           {[=] { table->gsgru_i8(layer->IntegerJob(integer_state->data())); }},
                           ErrorToScalar(*table, *layer, true),
                           kScalarLevels});
  }
#ifdef DCLOTH_BENCH_XNNPACK
  const auto peer = std::make_shared<XnnpackProducts>(*layer);
  contestants.push_back({"xnnpack *", {[=] { peer->Run(); }}, peer->error, peer->bound});
#endif
  // Not a contestant's turn: its loops fit no cache and meet none.
  const double rate = std::max(MultiplyAddRate(512), MultiplyAddRate(256));
  const double least_us = rate > 0 ? layer->Products() / rate * 1e-3 : 0;
  RunContest({name, layer->Bytes(), layer->Products()}, std::move(contestants),
             {{"", {}, 0, 0, {least_us}, {least_us}}});
}

std::vector<Contest> Contests() {
  constexpr std::pair<Place, const char*> kPlaces[] = {
      {Place::kHidden, "/hidden"}, {Place::kFirst, "/first"}, {Place::kEmbed, "/embed"}};
  std::vector<Contest> contests;
  for (const auto& [n, F] : {std::pair<size_t, size_t>{7952, 8}, {7964, 8}, {7964, 16}, {7964, 32}, {7964, 64}}) {
    for (const auto& [place, label] : kPlaces) {
      contests.push_back({"gsgru/n" + std::to_string(n) + "/F" + std::to_string(F) + label,
                          [=, vertices = n, features = F, where = place](const std::string& name) {
                            Run(name, vertices, features, where);
                          }});
    }
  }
  return contests;
}

}  // namespace
}  // namespace dcloth::kernels

int main(int argc, char** argv) {
#ifdef DCLOTH_BENCH_XNNPACK
  std::printf("xnnpack *: the layer's products alone, without neighbours, gates and norm\n");
#endif
  return dcloth::kernels::RunContests(argc, argv, dcloth::kernels::Contests());
}
