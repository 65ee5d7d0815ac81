// Each kernel of a frame beside what it must compute and move, and how near it comes to what the machine can do.
#ifndef DCLOTH_TOOLS_PROFILE_KERNELS_H_
#define DCLOTH_TOOLS_PROFILE_KERNELS_H_

#include <optional>
#include <vector>

#include "tools/profile_output.h"

namespace dcloth::tools {

struct KernelRow {
  converter::WorkPart part;
  converter::PartWork work;
  std::optional<Percentiles> ms;  // none where the tick is spread over frames
  double arithmetic_ms = 0;       // its operations at the machine's peak; int8 at twice that of float32
  double memory_ms = 0;           // its bytes at the machine's read rate: from memory with --cold, else from the caches

  bool memory_bound() const { return memory_ms > arithmetic_ms; }
  double limit_ms() const { return memory_bound() ? memory_ms : arithmetic_ms; }
};

// What the model has, in the engine's order.
std::vector<KernelRow> KernelRows(const Profile& profile);

Json KernelsJson(const Profile& profile);
Json MachineJson(const Profile& profile);
void PrintKernels(const Profile& profile);

// Frames by their time: equal factors from the fastest to p99, and one more for the rest.
struct Histogram {
  std::vector<double> edges_ms;  // one more than counts; the last one is the slowest frame
  std::vector<size_t> counts;
};
Histogram HistogramOf(const Profile& profile);
Json HistogramJson(const Profile& profile);
void PrintHistogram(const Profile& profile);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PROFILE_KERNELS_H_
