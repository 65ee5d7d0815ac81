// Contestants that do the same work, timed in turn in one process on one core: each round calls every one once, so that
// a clock that drops or a neighbour that wakes meets all alike. Warm: its own data came through the caches just before.
// Cold: the caches are emptied before the call, because in a game everything else of the frame did.
#ifndef DCLOTH_BENCH_KERNELS_CONTEST_H_
#define DCLOTH_BENCH_KERNELS_CONTEST_H_

#include <functional>
#include <string>
#include <vector>

namespace dcloth::kernels {

// The same call on data at several places in memory, taken in turn: pages lie more or less luckily for caches and
// memory banks, by a third of the time where they are cold.
struct Contestant {
  std::string name;
  std::vector<std::function<void()>> calls;
  double error = 0;  // largest difference to the truth, checked before anything is timed
  double bound = 0;  // what `error` may be at most
  std::vector<double> warm_us = {}, cold_us = {};
};

struct Work {
  std::string name;
  double bytes;
  double multiply_adds;
};

// Times `contestants` against `limits`, which do the least that any of them must do (or, without calls, bring their
// samples) and whose best is the limit. The fraction reached compares least time with least time, median with median.
// Prints a line each. Throws std::runtime_error for an error beyond its bound.
void RunContest(const Work& work, std::vector<Contestant> contestants, std::vector<Contestant> limits);

struct Contest {
  std::string name;
  std::function<void(const std::string& name)> run;
};

// A program's main: runs the contests whose name contains one of the arguments, all without arguments. 1 for an output
// that is wrong, 2 where no name matches.
int RunContests(int argc, char** argv, const std::vector<Contest>& contests);

}  // namespace dcloth::kernels

#endif  // DCLOTH_BENCH_KERNELS_CONTEST_H_
