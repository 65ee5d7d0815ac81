// `dcloth profile`: what a frame costs on one core, step by step, and whether it keeps a budget.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>

#include "converter/error.h"
#include "tools/commands.h"
#include "tools/contend.h"
#include "tools/machine.h"
#include "tools/machine_limit.h"
#include "tools/part_timer.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/profile_output.h"
#include "tools/progress.h"

namespace dcloth::tools {
namespace {

// Fewer samples give no p99 worth its name: below a hundred it is the maximum.
constexpr size_t kDefaultFrames = 600;

struct Options {
  std::filesystem::path model, sequence, trace;
  double budget_ms = 0, fps = 60;
  size_t frames = kDefaultFrames;
  int core = -1;
  bool pipelined = false, cold = false, contend = false, project = false, json = false;
};

class Profiler {
 public:
  Profiler(const Options& options, const converter::OpenModel& model, const converter::Sequence& sequence)
      : options_(options),
        sequence_(sequence),
        poses_(sequence, model.joint_names()),
        player_(model, model.info().stages, converter::PathText(options.sequence)),
        meter_(model.triangles(), model.info().vertex_count),
        pose_(poses_.joint_count() * 16),
        frame_count_(FrameCount(poses_, options.fps, sequence.path)) {
    if (options.cold) evictor_.emplace();
    if (frame_count_ < 2) {
      throw converter::Error({.path = sequence.path,
                              .tensor = {},
                              .found = "a single frame at " + converter::NumberText(options.fps) + " Hz",
                              .expected = "two frames or more, because the first one is not counted",
                              .mend = "pass a longer sequence or a higher --fps"});
    }
    if (sequence.has_truth() && sequence.truth_vertex_count != model.info().vertex_count) {
      throw converter::Error(
          {.path = sequence.path,
           .tensor = "truth",
           .found = std::to_string(sequence.truth_vertex_count) + " vertices",
           .expected = std::to_string(model.info().vertex_count) + ", as '" + model.info().name + "' has",
           .mend = "profile the garment that the sequence was simulated with"});
    }
  }

  // From a reset through the whole sequence. Only the engine's calls are timed, and the first frame, which
  // starts with a whole tick in any mode, is not kept. The first round is the one that does not count.
  void Round(bool first, std::vector<ProfiledFrame>* frames) {
    player_.Reset();
    for (size_t f = 0; f < frame_count_; ++f) {
      const double seconds = static_cast<double>(f) / options_.fps;
      poses_.At(seconds, pose_);
      player_.SetWind(poses_.WindAt(seconds));
      if (evictor_ && !first) player_.Cool(pose_, &*evictor_);
      const ProfiledFrame frame = Time();
      if (f != 0) frames->push_back(frame);
      if (first) Compare(seconds);
    }
  }

  converter::MeshError error() const { return meter_.Result(); }

 private:
  // One frame in two calls, so that ticks and drawing are told apart: an update without drawing, then one
  // without time.
  ProfiledFrame Time() {
    const uint32_t flags = options_.pipelined ? DCLOTH_FRAME_PIPELINED : 0;
    ProfiledFrame frame;
    frame.start_ns = NowNanoseconds();
    frame.ticks = player_.Update(pose_, static_cast<float>(1 / options_.fps), flags, false, timer_.get());
    const uint64_t ticked = NowNanoseconds();
    const TimedParts tick = timer_.Take();
    frame.tick_steps = tick.steps;
    const uint64_t skin_start = NowNanoseconds();
    player_.Update(pose_, 0, flags, true, timer_.get());
    frame.skin_ns = NowNanoseconds() - skin_start;
    frame.tick_ns = ticked - frame.start_ns;
    const TimedParts skin = timer_.Take();
    frame.skin_steps = skin.steps;
    // A slice of a kernel says nothing of the kernel.
    const bool whole = !options_.pipelined;
    for (size_t p = 0; p < frame.parts.size(); ++p) frame.parts[p] = (whole ? tick.parts[p] : 0) + skin.parts[p];
    return frame;
  }

  // Frames that fall on a frame of the sequence are compared with its truth, as drawn.
  void Compare(double seconds) {
    if (!sequence_.has_truth()) return;
    const double position = seconds * sequence_.fps, nearest = std::round(position);
    if (std::abs(position - nearest) > 1e-6) return;
    meter_.AddFrame(player_.positions(), sequence_.FrameTruth(static_cast<size_t>(nearest)));
  }

  const Options& options_;
  const converter::Sequence& sequence_;
  PoseTrack poses_;
  Player player_;
  converter::ErrorMeter meter_;
  std::vector<float> pose_;
  PartTimer timer_;
  size_t frame_count_;
  std::optional<CacheEvictor> evictor_;
};

int RunProfile(const Options& options) {
  CommandFiles files;
  files.Reads("the model", options.model);
  files.Reads("the sequence", options.sequence);
  files.Writes("--trace", options.trace);
  files.Check();
  const converter::OpenModel model = OpenModelFile(options.model);
  const converter::Sequence sequence = converter::ReadSequence(options.sequence);
  Profile profile;
  const std::vector<int> cores = AllowedCores();
  const int core = options.core >= 0 ? options.core : cores.empty() ? 0 : cores.back();
  if (PinThread(core)) profile.core = core;
  profile.work = converter::CountWork(model.bytes());
  uint64_t frame_bytes = 0;
  for (const converter::PartWork& work : profile.work) frame_bytes += work.bytes();
  profile.limit = MeasureLimit(frame_bytes);
  std::optional<Contender> contender;
  if (options.contend) {
    const auto other = std::find_if(cores.begin(), cores.end(), [&](int c) { return c != core; });
    if (other == cores.end()) {
      throw converter::Error({.path = {},
                              .tensor = {},
                              .found = "--contend with a single core to run on",
                              .expected = "a second core for the thread of --contend",
                              .mend = "allow this process a second core"});
    }
    contender.emplace(*other);
  }
  Profiler profiler(options, model, sequence);
  {
    std::vector<ProfiledFrame> warm_up;
    profiler.Round(true, &warm_up);  // first touch of pages and code; not counted
    Progress progress("profiling");
    do {
      profiler.Round(false, &profile.frames);
      progress.Step(std::min(profile.frames.size(), options.frames), options.frames);
    } while (profile.frames.size() < options.frames);
  }
  profile.model = converter::PathText(options.model);
  profile.sequence = converter::PathText(options.sequence);
  profile.garment = model.info().name;
  profile.precision = model.info().precision;
  profile.model_bytes = model.bytes().size();
  profile.instance_bytes = model.instance_bytes();
  profile.fps = options.fps;
  profile.tick_rate = TickRate(model);
  profile.budget_ms = options.budget_ms;
  profile.pipelined = options.pipelined;
  profile.cold = options.cold;
  profile.contend = options.contend;
  profile.project = options.project;
  profile.error = profiler.error();
  if (!options.trace.empty()) WriteTrace(options.trace, profile);
  if (options.json) {
    PrintJson(ProfileJson(profile));
  } else {
    PrintProfile(profile);
  }
  if (profile.missed_frames() == 0) return kExitGood;
  std::fprintf(stderr, "dcloth: %zu of %zu frames missed the budget of %g ms\n", profile.missed_frames(),
               profile.frames.size(), options.budget_ms);
  return kExitThresholdMissed;
}

}  // namespace

void AddProfile(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("profile", "Measure what a frame costs on one core");
  command->footer(
      "A frame is what one dcloth_cloth_update does: the ticks that are due, or their share, then skinning with "
      "normals. The\n"
      "sequence repeats until --frames are measured, after one pass that is not counted. If the sequence has truth, "
      "the error of\n"
      "the drawn frames is printed below the times.");
  command->add_option("MODEL", options->model, "a .dcloth file")->required();
  command->add_option("SEQ", options->sequence, "a sequence (.safetensors)")->required();
  command->add_option("--budget-ms", options->budget_ms, "exit 1 if any frame takes longer")->check(NumberAboveZero());
  command->add_option("--fps", options->fps, "drawn frames per second")
      ->check(NumberWithin(1, 1000))
      ->capture_default_str();
  command
      ->add_option("--frames", options->frames,
                   "measure at least this many frames; the sequence is always played to its end")
      ->check(NumberWithin(1, 1'000'000))
      ->capture_default_str();
  command->add_option("--core", options->core, "the core to stay on. Default: the last one allowed")
      ->check(NumberWithin(0, 65535));
  AddIsaOption(command);
  command->add_flag("--pipelined", options->pipelined, "spread each tick over the frames until the next one");
  command->add_flag("--cold", options->cold, "empty the caches before every frame, outside of the timed part");
  command->add_flag("--contend", options->contend,
                    "run a second thread that uses memory and arithmetic on another core");
  command
      ->add_flag("--project", options->project,
                 "also print a projection, not a measurement, for devices that are not here: counted work and "
                 "published figures")
      ->needs("--cold")
      ->excludes("--pipelined");
  command->add_flag("--json", options->json, "one JSON object on stdout");
  command->add_option("--trace", options->trace, "also write a Chrome trace (.json)");
  command->callback([options, &exit_code] { exit_code = RunProfile(*options); });
}

}  // namespace dcloth::tools
