#include "bench/kernels/contest.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "bench/kernels/kernel_bench.h"

namespace dcloth::kernels {
namespace {

constexpr double kWarmSeconds = 0.1;  // a contestant
constexpr size_t kLeastRounds = 16, kMostRounds = 500, kColdRounds = 24;

double TimedUs(const std::function<void()>& call) {
  using Clock = std::chrono::steady_clock;
  const auto begin = Clock::now();
  call();
  benchmark::ClobberMemory();
  return std::chrono::duration<double, std::micro>(Clock::now() - begin).count();
}

double Least(const std::vector<double>& samples) { return *std::min_element(samples.begin(), samples.end()); }

double Median(std::vector<double> samples) {
  const auto middle = samples.begin() + static_cast<std::ptrdiff_t>(samples.size() / 2);
  std::nth_element(samples.begin(), middle, samples.end());
  return *middle;
}

struct Figures {
  double least, median;
};

Figures FiguresOf(const std::vector<double>& samples) { return {Least(samples), Median(samples)}; }

Figures Best(const std::vector<Contestant>& limits, std::vector<double> Contestant::*samples) {
  Figures best = {INFINITY, INFINITY};
  for (const Contestant& limit : limits) {
    const Figures f = FiguresOf(limit.*samples);
    best = {std::min(best.least, f.least), std::min(best.median, f.median)};
  }
  return best;
}

void PrintSide(const Work& work, Figures f, Figures limit) {
  std::printf(" %11.1f %9.1f %6.1f %6.1f %4.0f%% %4.0f%%", f.least, f.median, work.bytes / f.least * 1e-3,
              work.multiply_adds / f.least * 1e-3, 100 * limit.least / f.least, 100 * limit.median / f.median);
}

void PrintHeader() {
  std::printf("%-30s %-10s", "", "");
  for (const char* heading : {"warm: least", "cold: least"}) {
    std::printf(" %11s %9s %6s %6s %11s", heading, "median", "GB/s", "GMAC/s", "of limit");
  }
  std::printf(" %9s\n%-30s %-10s", "error", "", "");
  for (int side = 0; side < 2; ++side) std::printf(" %11s %9s %6s %6s %5s %5s", "us", "us", "", "", "least", "med.");
  std::printf("\n");
}

bool Wanted(const std::string& name, int argc, char** argv) {
  if (argc < 2) return true;
  return std::any_of(argv + 1, argv + argc, [&](const char* part) { return name.find(part) != std::string::npos; });
}

}  // namespace

void RunContest(const Work& work, std::vector<Contestant> contestants, std::vector<Contestant> limits) {
  double slowest_us = 0;
  std::vector<Contestant*> all;
  for (Contestant& c : contestants) {
    if (!(c.error <= c.bound)) {
      throw std::runtime_error(work.name + ", " + c.name + ": error " + std::to_string(c.error) + " exceeds " +
                               std::to_string(c.bound));
    }
    all.push_back(&c);
  }
  for (Contestant& limit : limits) {
    if (!limit.calls.empty()) all.push_back(&limit);
  }
  for (Contestant* c : all) slowest_us = std::max(slowest_us, TimedUs(c->calls[0]));

  const auto affordable = static_cast<size_t>(kWarmSeconds * 1e6 / slowest_us);
  const size_t warm_rounds = std::clamp(affordable, kLeastRounds, kMostRounds);
  for (size_t round = 0; round < warm_rounds; ++round) {
    for (Contestant* c : all) {
      const auto& call = c->calls[round % c->calls.size()];
      call();
      call();  // a last-level cache that takes what the second level drops keeps a block from the second pass on
      c->warm_us.push_back(TimedUs(call));
    }
  }
  for (size_t round = 0; round < kColdRounds; ++round) {
    for (Contestant* c : all) {
      EvictCaches();
      c->cold_us.push_back(TimedUs(c->calls[round % c->calls.size()]));
    }
  }

  const Figures warm_limit = Best(limits, &Contestant::warm_us), cold_limit = Best(limits, &Contestant::cold_us);
  const auto print = [&work, &warm_limit, &cold_limit](const std::string& name, Figures warm, Figures cold) {
    std::printf("%-30s %-10s", work.name.c_str(), name.c_str());
    PrintSide(work, warm, warm_limit);
    PrintSide(work, cold, cold_limit);
  };
  print("(limit)", warm_limit, cold_limit);
  std::printf("\n");
  for (const Contestant& c : contestants) {
    print(c.name, FiguresOf(c.warm_us), FiguresOf(c.cold_us));
    std::printf(" %9.1e\n", c.error);
  }
  std::fflush(stdout);
}

int RunContests(int argc, char** argv, const std::vector<Contest>& contests) {
  PrintHeader();
  bool any = false;
  try {
    for (const Contest& contest : contests) {
      if (!Wanted(contest.name, argc, argv)) continue;
      any = true;
      contest.run(contest.name);
    }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  if (!any) std::fprintf(stderr, "no contest has such a name\n");
  return any ? 0 : 2;
}

}  // namespace dcloth::kernels
