#include "tools/profile_kernels.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <string>

namespace dcloth::tools {
namespace {

constexpr size_t kBins = 16;

std::optional<Percentiles> TimesOf(const Profile& profile, size_t part) {
  std::vector<double> samples;
  for (const ProfiledFrame& f : profile.frames) {
    if (f.parts[part] > 0) samples.push_back(static_cast<double>(f.parts[part]) * 1e-6);
  }
  if (samples.empty()) return std::nullopt;
  return PercentilesOf(samples);
}

double ReadGbs(const Profile& profile) { return profile.cold ? profile.limit.memory_gbs : profile.limit.read_gbs; }

double PerSecond(double amount, double ms) { return ms > 0 ? amount / ms * 1e-6 : 0; }  // 1e9 a second

}  // namespace

std::vector<KernelRow> KernelRows(const Profile& profile) {
  std::vector<KernelRow> rows;
  for (size_t p = 0; p < converter::kWorkPartCount; ++p) {
    const converter::PartWork& work = profile.work[p];
    if (work.bytes() == 0) continue;
    KernelRow row{static_cast<converter::WorkPart>(p), work, TimesOf(profile, p)};
    const double peak = profile.limit.gflops * (work.int8 ? 2 : 1);
    row.arithmetic_ms = static_cast<double>(work.flops) / peak * 1e-6;
    row.memory_ms = static_cast<double>(work.bytes()) / ReadGbs(profile) * 1e-6;
    rows.push_back(row);
  }
  return rows;
}

Json KernelsJson(const Profile& profile) {
  Json rows = Json::array();
  for (const KernelRow& row : KernelRows(profile)) {
    Json json = {{"name", converter::WorkPartName(row.part)},
                 {"stage", kStepNames[static_cast<size_t>(converter::StepOf(row.part))]},
                 {"flops", row.work.flops},
                 {"bytes", row.work.bytes()},
                 {"weight_bytes", row.work.weight_bytes},
                 {"int8", row.work.int8},
                 {"bound", row.memory_bound() ? "memory" : "arithmetic"},
                 {"limit_ms", row.limit_ms()},
                 {"ms", nullptr},
                 {"fraction_of_limit", nullptr}};
    if (row.ms) {
      json["ms"] = ToJson(*row.ms);
      json["fraction_of_limit"] = row.limit_ms() / row.ms->p50;
    }
    rows.push_back(std::move(json));
  }
  return rows;
}

Json MachineJson(const Profile& profile) {
  return {{"gflops", profile.limit.gflops},
          {"unit", profile.limit.unit},
          {"read_bytes", profile.limit.read_bytes},
          {"read_gbs", profile.limit.read_gbs},
          {"memory_gbs", profile.limit.memory_gbs}};
}

void PrintKernels(const Profile& profile) {
  const MachineLimit& limit = profile.limit;
  std::printf(
      "\nthis core's limits, measured: %.1f GFLOP/s (%s), %.1f GB/s from caches (%.1f MB again and again), "
      "%.1f GB/s from memory\n\n",
      limit.gflops, limit.unit, limit.read_gbs, static_cast<double>(limit.read_bytes) / 1e6, limit.memory_gbs);
  std::printf("  %-17s %9s %9s %9s %9s %9s %9s %9s\n", "kernel", "p50 ms", "MFLOP", "MB", "GFLOP/s", "GB/s", "limit ms",
              "reached");
  for (const KernelRow& row : KernelRows(profile)) {
    const double flops = static_cast<double>(row.work.flops), bytes = static_cast<double>(row.work.bytes());
    std::printf("  %-17s", converter::WorkPartName(row.part));
    if (row.ms) {
      std::printf(" %9.4f", row.ms->p50);
    } else {
      std::printf(" %9s", "-");
    }
    std::printf(" %9.3f %9.3f", flops / 1e6, bytes / 1e6);
    if (row.ms) {
      std::printf(" %9.1f %9.1f %9.4f %7.0f %% of %s\n", PerSecond(flops, row.ms->p50), PerSecond(bytes, row.ms->p50),
                  row.limit_ms(), 100 * row.limit_ms() / row.ms->p50, row.memory_bound() ? "memory" : "arithmetic");
    } else {
      std::printf(" %9s %9s %9.4f\n", "-", "-", row.limit_ms());
    }
  }
  if (profile.pipelined) std::printf("  kernels of a tick that is spread over frames are not told apart\n");
}

Histogram HistogramOf(const Profile& profile) {
  std::vector<double> samples;
  for (const ProfiledFrame& f : profile.frames) samples.push_back(FrameMs(f));
  Histogram histogram;
  if (samples.empty()) return histogram;
  const Percentiles p = PercentilesOf(samples);
  const double low = *std::min_element(samples.begin(), samples.end());
  const double step = std::max(std::log(p.p99 / low) / static_cast<double>(kBins), 1e-9);
  for (size_t i = 0; i <= kBins; ++i) histogram.edges_ms.push_back(low * std::exp(static_cast<double>(i) * step));
  histogram.edges_ms.push_back(std::max(p.max, histogram.edges_ms.back()));
  histogram.counts.assign(kBins + 1, 0);
  for (const double ms : samples) {
    // The fastest frame is in the first bin; what lies beyond p99 in the last.
    const auto bin = static_cast<size_t>(std::log(ms / low) / step);
    ++histogram.counts[ms > p.p99 ? kBins : std::min(bin, kBins - 1)];
  }
  return histogram;
}

Json HistogramJson(const Profile& profile) {
  const Histogram histogram = HistogramOf(profile);
  return {{"edges_ms", histogram.edges_ms}, {"counts", histogram.counts}};
}

void PrintHistogram(const Profile& profile) {
  const Histogram histogram = HistogramOf(profile);
  if (histogram.counts.empty()) return;
  constexpr size_t kWidth = 50;
  const size_t most = *std::max_element(histogram.counts.begin(), histogram.counts.end());
  std::printf("\n  frame ms\n");
  for (size_t i = 0; i < histogram.counts.size(); ++i) {
    const size_t count = histogram.counts[i], length = (count * kWidth + most - 1) / most;
    const bool late = profile.budget_ms > 0 && histogram.edges_ms[i + 1] > profile.budget_ms;
    std::printf("  %8.4f %-6s %6zu %s%s\n", histogram.edges_ms[i], i < kBins ? "" : "(p99)", count,
                std::string(length, '#').c_str(), late && count > 0 ? "  past the budget, in part or whole" : "");
  }
}

}  // namespace dcloth::tools
