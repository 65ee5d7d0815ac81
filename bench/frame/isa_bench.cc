// The whole network on each instruction set, tick by tick in turn, in one process on one core: least times and medians,
// and how far the vertices are from those of the first one named.
//
//   bench_isa paper.dcloth sequence.safetensors --isa avx2 --isa avx3 [--cold]
//
// A tick is features, stages, displacement, skinning and normals. Times are the thread's processor time, so that what
// other programs take of the core is left out; what they take of its caches is not: compare least times.
#include <time.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "bench/frame/run.h"
#include "converter/rollout.h"
#include "tools/machine.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

namespace dcloth::tools {
namespace {

uint64_t ThreadNanoseconds(void*) {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<uint64_t>(now.tv_sec) * 1'000'000'000 + static_cast<uint64_t>(now.tv_nsec);
}

struct Contestant {
  Contestant(const std::string& isa, const std::filesystem::path& path)
      : name(isa), model(OpenModelFile(path)), player(model, model.info().stages, path.string()) {}

  void Select() const {
    if (dcloth_isa_select(name.c_str()) == DCLOTH_OK) return;
    throw std::runtime_error("--isa " + name + ": not in this build or not run by this CPU");
  }

  void Tick(std::span<const float> pose) {
    Select();
    StepTimer timer;
    timer.get()->now = ThreadNanoseconds;
    const uint64_t start = ThreadNanoseconds(nullptr);
    player.Tick(pose, timer.get());
    player.Skin(pose, 1, timer.get());
    whole_ms.push_back(static_cast<double>(ThreadNanoseconds(nullptr) - start) * 1e-6);
    const StepTimes times = timer.Take();
    for (size_t s = 0; s < times.size(); ++s) step_ms[s].push_back(static_cast<double>(times[s]) * 1e-6);
  }

  std::string name;
  converter::OpenModel model;
  Player player;
  std::vector<double> whole_ms;
  std::array<std::vector<double>, DCLOTH_STEP_COUNT> step_ms;
  double sum_mm = 0, max_mm = 0;
  size_t distances = 0;
};

void Compare(const Contestant& first, Contestant* other) {
  const std::span<const float> a = first.player.positions(), b = other->player.positions();
  for (size_t i = 0; i < a.size(); i += 3) {
    const double mm = 1e3 * std::hypot(a[i] - b[i], a[i + 1] - b[i + 1], a[i + 2] - b[i + 2]);
    other->sum_mm += mm;
    other->max_mm = std::max(other->max_mm, mm);
  }
  other->distances += a.size() / 3;
}

double Least(const std::vector<double>& samples) { return *std::min_element(samples.begin(), samples.end()); }

void Print(const Contestant& c) {
  std::printf("%-13s %8.3f %8.3f %9.3f %9.3f", c.name.c_str(), Least(c.whole_ms), PercentilesOf(c.whole_ms).p50,
              Least(c.step_ms[DCLOTH_STEP_MESH]), PercentilesOf(c.step_ms[DCLOTH_STEP_MESH]).p50);
  for (const auto& samples : c.step_ms) std::printf(" %12.3f", Least(samples));
  std::printf(" %9.6f %9.6f\n", c.sum_mm / static_cast<double>(c.distances), c.max_mm);
}

}  // namespace

int Run(int argc, char** argv) {
  std::filesystem::path model_path, motion_path;
  std::vector<std::string> names = {"avx2", "avx3"};
  size_t ticks = 300;
  bool cold = false;
  CLI::App app("Instruction sets side by side");
  app.add_option("MODEL", model_path)->required();
  app.add_option("SEQ", motion_path)->required();
  app.add_option("--isa", names)->allow_extra_args(false);
  app.add_option("--ticks", ticks, "per instruction set")->capture_default_str();
  app.add_flag("--cold", cold, "empty the caches before every tick");
  CLI11_PARSE(app, argc, argv);

  std::vector<std::unique_ptr<Contestant>> contestants;
  for (const std::string& name : names) contestants.push_back(std::make_unique<Contestant>(name, model_path));
  const PoseTrack poses(converter::ReadSequence(motion_path), contestants[0]->model.joint_names());
  CacheEvictor evictor;
  for (size_t tick = 0; tick < ticks; ++tick) {
    const size_t frame = tick % poses.frame_count();
    for (size_t i = 0; i < contestants.size(); ++i) {
      Contestant& contestant = *contestants[(i + tick) % contestants.size()];
      if (frame == 0) contestant.player.Reset();
      if (cold) contestant.player.Cool(poses.Frame(frame), &evictor);
      contestant.Tick(poses.Frame(frame));
    }
    for (const auto& contestant : contestants) Compare(*contestants[0], contestant.get());
  }
  std::printf("%s, %s, %zu ticks each, ms\n%-13s %8s %8s %9s %9s", CpuName().c_str(), cold ? "cold" : "warm", ticks, "",
              "least", "p50", "mesh", "mesh p50");
  for (const char* step : kStepNames) std::printf(" %12s", step);
  std::printf(" %9s %9s\n", "mm mean", "max");
  for (const auto& contestant : contestants) Print(*contestant);
  return 0;
}

}  // namespace dcloth::tools
