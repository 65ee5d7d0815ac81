// Integer products of many inputs: those of a patch stage (the skirt's sizes, 32 patches), each alone and all in the
// order of a tick; the best instruction sets, the same inputs one by one, and XNNPACK in float where the build found
// it, in turn.
//
//   bench_matmul          all of them
//   bench_matmul stage    those whose name has the word
//
// Inputs are quantised beforehand. The limit is what bare multiply-adds in float would take.
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "bench/kernels/contest.h"
#include "bench/kernels/fma_loop.h"
#include "bench/kernels/kernel_bench.h"
#include "kernels/matvec/matvec_pack.h"
#ifdef DCLOTH_BENCH_XNNPACK
#include "bench/kernels/xnnpack_dense.h"
#endif

namespace dcloth::kernels {
namespace {

constexpr size_t kInputs = 32;
constexpr float kXScale = 1.0f / 8192, kColumnScale = 1.0f / 127;

// y = x W with the same integers for all contestants.
struct Product {
  size_t rows, columns, padded;
  std::vector<float> matrix, floats, y;  // [rows, columns], [kInputs, rows], [kInputs, padded]
  std::vector<int16_t> x;                // [kInputs, rows]
  AlignedArray<int8_t> weights;
  AlignedArray<float> scales, x_scales;
  std::vector<double> exact;  // [kInputs, columns]
  double bound = 0;

  Product(size_t r, size_t c)
      : rows(r),
        columns(c),
        padded(PaddedColumns(c)),
        matrix(r * c),
        floats(kInputs * r),
        y(kInputs * padded),
        x(kInputs * r),
        weights(PairPanelElements(r, c)),
        scales(padded),
        x_scales(kInputs),
        exact(kInputs * c) {
    std::mt19937 engine(7);
    std::vector<int8_t> source(r * c);
    for (size_t i = 0; i < source.size(); ++i) {
      source[i] = static_cast<int8_t>(static_cast<int>(engine() % 255) - 127);
      matrix[i] = static_cast<float>(source[i]) * kColumnScale;
    }
    for (size_t i = 0; i < x.size(); ++i) {
      x[i] = static_cast<int16_t>(static_cast<int>(engine() % 16384) - 8192);
      floats[i] = static_cast<float>(x[i]) * kXScale;
    }
    PackPairPanelsI8(source.data(), {r, c, c, 1}, weights.data());
    std::fill_n(scales.data(), padded, kColumnScale);
    std::fill_n(x_scales.data(), kInputs, kXScale);
    for (size_t i = 0; i < kInputs; ++i) {
      for (size_t j = 0; j < r; ++j) {
        for (size_t k = 0; k < c; ++k) exact[i * c + k] += double{floats[i * r + j]} * matrix[j * c + k];
      }
    }
    bound = static_cast<double>((r + 2) * r) * 0x1p-24;  // a rounding a row of terms within 1
  }

  double Error(size_t stride) const {
    double error = 0;
    for (size_t i = 0; i < kInputs; ++i) {
      for (size_t k = 0; k < columns; ++k) {
        error = std::max(error, std::fabs(y[i * stride + k] - exact[i * columns + k]));
      }
    }
    return error;
  }

  void Run(const KernelTable& table) {
    table.matmul_i8({x.data(), x_scales.data(), weights.data(), scales.data(), nullptr, y.data(), kInputs, rows, padded,
                     rows, rows, PanelCount(columns), false});
  }
  void RunOneByOne(const KernelTable& table) {
    for (size_t i = 0; i < kInputs; ++i) {
      table.matvec_i8({x.data() + i * rows, weights.data(), scales.data(), nullptr, y.data() + i * padded, x_scales[i],
                       rows, rows, PanelCount(columns), false});
    }
  }
};

using Products = std::vector<Product>;

// `run(p)` computes product p, whose rows of y are then `stride(p)` apart.
template <typename RunProduct, typename Stride>
Contestant Enter(const std::string& name, Products* products, RunProduct run, Stride stride) {
  Contestant contestant{name, {}};
  for (Product& p : *products) {
    std::fill(p.y.begin(), p.y.end(), 0.0f);
    run(p);
    contestant.error = std::max(contestant.error, p.Error(stride(p)));
    contestant.bound = std::max(contestant.bound, p.bound);
  }
  contestant.calls.push_back([=] {
    for (Product& p : *products) run(p);
  });
  return contestant;
}

void Run(const std::string& name, const std::vector<std::pair<size_t, size_t>>& shapes) {
  Products products;
  Work work = {name, 0, 0};
  for (const auto& [rows, columns] : shapes) {
    const Product& p = products.emplace_back(rows, columns);
    work.bytes += static_cast<double>(p.rows * p.padded);
    work.multiply_adds += static_cast<double>(kInputs * rows * columns);
  }
  std::vector<Contestant> contestants;
  const auto padded = [](const Product& p) { return p.padded; };
  for (const KernelTable* table : BestTables()) {
    contestants.push_back(Enter(
        table->name, &products, [=](Product& p) { p.Run(*table); }, padded));
    contestants.push_back(Enter(
        table->name + std::string(" 1x1"), &products, [=](Product& p) { p.RunOneByOne(*table); }, padded));
  }
#ifdef DCLOTH_BENCH_XNNPACK
  const auto peers = std::make_shared<std::vector<XnnpackDense>>();
  for (Product& p : products) {
    peers->emplace_back(p.matrix.data(), p.rows, p.columns, kInputs, p.floats.data(), p.y.data());
  }
  contestants.push_back(Enter(
      "xnnpack f32", &products, [=, &products](Product& p) { (*peers)[static_cast<size_t>(&p - &products[0])].Run(); },
      [](const Product& p) { return p.columns; }));
#endif
  const double rate = std::max(MultiplyAddRate(512), MultiplyAddRate(256));
  const double least_us = rate > 0 ? work.multiply_adds / rate * 1e-3 : 0;
  RunContest(work, std::move(contestants), {{"", {}, 0, 0, {least_us}, {least_us}}});
}

std::vector<Contest> Contests() {
  std::vector<std::pair<std::string, std::vector<std::pair<size_t, size_t>>>> cases = {
      {"stage", {{192, 128}, {384, 128}, {384, 128}, {384, 128}, {128, 384}, {128, 384}, {320, 24}}},
      {"enter", {{192, 128}}},
      {"mix", {{384, 128}}},
      {"gates", {{128, 384}}},
      {"out", {{320, 24}}}};
  std::vector<Contest> contests;
  for (const auto& [name, shapes] : cases) {
    contests.push_back({"patch_" + name, [shapes = shapes](const std::string& label) { Run(label, shapes); }});
  }
  return contests;
}

}  // namespace
}  // namespace dcloth::kernels

int main(int argc, char** argv) { return dcloth::kernels::RunContests(argc, argv, dcloth::kernels::Contests()); }
