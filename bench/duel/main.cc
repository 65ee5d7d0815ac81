// Plays a clip with each contestant in turn, on one core, and prints what each frame took.
//
//   dcloth_duel SEQ -o FOLDER --play NAME,METHOD,FILE[,KEY=VALUE...]... [--rounds N] [--hz 60] [--seconds S]
//     [--event EVENT]
//
// METHOD: dcloth (FILE: a .dcloth model), jolt, solver or springs (FILE: a case of duel/garment.py). The true shape in
// the first frame is where all start; the first pose is held for a second, which does not count. EVENT: none, hitch (a
// tenth of a second in one frame), teleport (moved by 5 m, which the host says) or unsaid (moved, and it does not say).
// JSON on stdout: wall and thread time of each frame in ns, the least of the rounds, and bytes.
// FOLDER/NAME.safetensors: positions [k, n, 3] at the clip's own frames, of the first round, and their times [k] s.
#include <time.h>
#ifdef __SSE__
#include <xmmintrin.h>
#endif

#include <CLI/CLI.hpp>
#include <cstdio>
#include <sstream>

#include "bench/duel/method.h"
#include "converter/sequence.h"
#include "tools/json_output.h"
#include "tools/machine.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

namespace dcloth::duel {
namespace {

constexpr int kHeldFrames = 60;
constexpr float kTeleport[3] = {4, 0, 3};

#ifndef DCLOTH_DUEL_JOLT
}
std::unique_ptr<Method> MakeJolt(const Case&, const Options&) { return nullptr; }
namespace {
#endif

struct Contestant {
  std::string name, kind;
  std::unique_ptr<Method> method;
  std::vector<double> wall, thread;
};

uint64_t ThreadNanoseconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<uint64_t>(now.tv_sec) * 1000000000 + static_cast<uint64_t>(now.tv_nsec);
}

Contestant Parse(const std::string& text, double hz, const std::vector<std::string>& joints) {
  std::istringstream parts(text);
  std::string name, kind, file, item;
  std::getline(parts, name, ','), std::getline(parts, kind, ','), std::getline(parts, file, ',');
  Options options;
  options["hz"] = hz, options.Get("hz", hz);
  while (std::getline(parts, item, ',')) {
    const size_t equals = item.find('=');
    if (equals == std::string::npos) throw std::runtime_error("--play " + text + ": '" + item + "' is no KEY=VALUE");
    options[item.substr(0, equals)] = std::stod(item.substr(equals + 1));
  }
  Contestant out{name, kind, nullptr, {}, {}};
  if (kind == "dcloth")
    out.method = MakeNetwork(file, options, joints);
  else if (kind == "springs")
    out.method = MakeSprings(Case(file), options);
  else if (kind == "solver")
    out.method = MakeSolver(Case(file), options);
  else if (kind == "jolt")
    out.method = MakeJolt(Case(file), options);
  if (!out.method)
    throw std::runtime_error("--play " + text + ": method '" + kind + "'; allowed here: dcloth, springs, solver" +
                             (kind == "jolt" ? "; jolt needs a build with DCLOTH_DUEL_JOLT" : ", jolt"));
  if (!options.Unread().empty())
    throw std::runtime_error("--play " + text + ": " + kind + " has no setting '" + options.Unread() + "'");
  return out;
}

// A frame of the host: its time in the clip, and how long after the one before.
struct Moment {
  double at;
  float seconds;
  bool moved, jumps;
};

std::vector<Moment> Schedule(double duration, double hz, const std::string& event) {
  std::vector<Moment> out;
  const long half = 2 * std::lround(0.25 * duration * hz), last = static_cast<long>(duration * hz + 1e-6);
  for (long f = 1; f <= last; ++f) {
    Moment now{static_cast<double>(f) / hz, static_cast<float>(1 / hz), false, false};
    const long hitch = std::lround(0.1 * hz);
    if (event == "hitch" && f > half && f < half + hitch) continue;
    if (event == "hitch" && f == half + hitch) now.seconds = 0.1F;
    if (event == "teleport" || event == "unsaid") now.moved = f >= half, now.jumps = f == half;
    out.push_back(now);
  }
  return out;
}

class Show {
 public:
  Show(const std::filesystem::path& path, double hz, double seconds, std::string event)
      : sequence_(converter::ReadSequence(path)),
        track_(sequence_, sequence_.joint_names),
        event_(std::move(event)),
        schedule_(Schedule(std::min(seconds, track_.duration_seconds()), hz, event_)),
        hz_(hz) {
    if (!sequence_.has_truth()) throw std::runtime_error(path.string() + ": no truth; contestants start from it");
  }

  // Fills in times, and `positions` of frames that are the clip's own where wanted.
  void Play(Contestant& one, std::vector<float>* positions, std::vector<float>* times) const {
    std::vector<float> pose(track_.joint_count() * 16);
    track_.At(0, pose);
    one.method->Start(pose, sequence_.FrameTruth(0));
    for (int f = 0; f < kHeldFrames; ++f) one.method->Frame(pose, static_cast<float>(1 / hz_), false);
    one.wall.resize(schedule_.size(), 1e18), one.thread.resize(schedule_.size(), 1e18);
    // The host of a simulation moves its origin with the figure: a jump that it is told of does not exist for it.
    const bool moves = event_ == "unsaid" || one.kind == "dcloth";
    for (size_t f = 0; f < schedule_.size(); ++f) {
      const Moment& now = schedule_[f];
      track_.At(now.at, pose);
      const bool shifted = moves && now.moved;
      if (shifted)
        for (size_t k = 0; k < pose.size(); ++k)
          if (k % 4 == 3 && k % 16 < 12) pose[k] += kTeleport[k % 16 / 4];
      const uint64_t cpu = ThreadNanoseconds(), start = tools::NowNanoseconds();
      one.method->Frame(pose, now.seconds, now.jumps && event_ == "teleport");
      one.wall[f] = std::min(one.wall[f], static_cast<double>(tools::NowNanoseconds() - start));
      one.thread[f] = std::min(one.thread[f], static_cast<double>(ThreadNanoseconds() - cpu));
      const double own = now.at * track_.fps();
      if (positions == nullptr || std::abs(own - std::round(own)) > 1e-3) continue;
      times->push_back(static_cast<float>(now.at));
      for (size_t i = 0; i < one.method->positions().size(); ++i)
        positions->push_back(one.method->positions()[i] - (shifted ? kTeleport[i % 3] : 0));
    }
  }

  const std::vector<std::string>& joints() const { return sequence_.joint_names; }

 private:
  converter::Sequence sequence_;
  tools::PoseTrack track_;
  std::string event_;
  std::vector<Moment> schedule_;
  double hz_;
};

void Write(const std::filesystem::path& path, const std::vector<float>& positions, const std::vector<float>& times) {
  const uint64_t rows = times.size(), count = rows == 0 ? 0 : positions.size() / 3 / rows;
  const std::vector<converter::SafeTensor> tensors = {
      {"positions", converter::SafeType::kF32, {rows, count, 3}, std::as_bytes(std::span(positions))},
      {"times", converter::SafeType::kF32, {rows}, std::as_bytes(std::span(times))}};
  converter::WriteSafetensors(path, tensors, {});
}

int Run(int argc, char** argv) {
  std::filesystem::path sequence, folder;
  std::vector<std::string> plays;
  std::string event = "none";
  int rounds = 1;
  double hz = 60, seconds = 1e6;
  CLI::App app("Cloth in a duel");
  app.add_option("SEQ", sequence)->required();
  app.add_option("-o,--out", folder, "folder for positions; none: they are not written");
  app.add_option("--play", plays, "NAME,METHOD,FILE[,KEY=VALUE...]")->required()->allow_extra_args(false);
  app.add_option("--rounds", rounds)->check(CLI::PositiveNumber);
  app.add_option("--hz", hz)->check(CLI::Range(10, 240));
  app.add_option("--seconds", seconds, "of the clip, at most")->check(CLI::PositiveNumber);
  app.add_option("--event", event)->check(CLI::IsMember({"none", "hitch", "teleport", "unsaid"}));
  CLI11_PARSE(app, argc, argv);
  const std::vector<int> cores = tools::AllowedCores();
  if (!cores.empty()) tools::PinThread(cores.back());
#ifdef __SSE__
  _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON);  // simulations come to rest through subnormals
#endif
  const Show show(sequence, hz, seconds, event);
  std::vector<Contestant> contestants;
  for (const std::string& play : plays) contestants.push_back(Parse(play, hz, show.joints()));
  for (int round = 0; round < rounds; ++round) {
    for (Contestant& one : contestants) {
      std::vector<float> positions, times;
      const bool wanted = round == 0 && !folder.empty();
      show.Play(one, wanted ? &positions : nullptr, &times);
      if (wanted) Write(folder / (one.name + ".safetensors"), positions, times);
    }
  }
  tools::Json json = {{"cpu", tools::CpuName()}, {"isa", dcloth_isa_name()}, {"rows", tools::Json::array()}};
  for (const Contestant& one : contestants)
    json["rows"].push_back({{"name", one.name},
                            {"wall_ns", one.wall},
                            {"thread_ns", one.thread},
                            {"instance_bytes", one.method->instance_bytes()},
                            {"shared_bytes", one.method->shared_bytes()}});
  tools::PrintJson(json);
  return 0;
}

}  // namespace
}  // namespace dcloth::duel

int main(int argc, char** argv) {
  try {
    return dcloth::duel::Run(argc, argv);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "dcloth_duel: %s\n", error.what());
    return 2;
  }
}
