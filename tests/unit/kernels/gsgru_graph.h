// A graph for the tests of the layer: every vertex holds itself, every fifth is otherwise isolated, the hub touches all
// others, the rest have up to 8 more neighbours.
#ifndef DCLOTH_TESTS_UNIT_KERNELS_GSGRU_GRAPH_H_
#define DCLOTH_TESTS_UNIT_KERNELS_GSGRU_GRAPH_H_

#include <cstdint>
#include <vector>

#include "tests/unit/kernels/kernel_test.h"

namespace dcloth::kernels {

struct Graph {
  static constexpr size_t kHub = 3;
  std::vector<uint32_t> row_starts = {0};
  std::vector<uint16_t> columns;

  Graph(size_t vertices, Random& random) {
    for (size_t i = 0; i < vertices; ++i) {
      columns.push_back(static_cast<uint16_t>(i));
      const size_t extra = i == kHub ? vertices - 1 : i % 5 == 0 ? 0 : 1 + random.Below(8);
      for (size_t k = 0; k < extra; ++k) {
        const size_t other = i == kHub ? (i + 1 + k) % vertices : random.Below(static_cast<uint32_t>(vertices));
        columns.push_back(static_cast<uint16_t>(other));
      }
      row_starts.push_back(static_cast<uint32_t>(columns.size()));
    }
  }
};

}  // namespace dcloth::kernels

#endif  // DCLOTH_TESTS_UNIT_KERNELS_GSGRU_GRAPH_H_
