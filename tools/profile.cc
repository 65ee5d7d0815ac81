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
#include "tools/profile_crowd.h"
#include "tools/profile_output.h"
#include "tools/progress.h"

namespace dcloth::tools {
namespace {

// Fewer samples give no p99 worth its name: below a hundred it is the maximum.
constexpr size_t kDefaultFrames = 600;
constexpr size_t kMostInterrupted = 4;  // times the frames that are asked for: then the core is too busy to wait longer

struct Options {
  std::filesystem::path model, sequence, trace;
  std::string stages;
  std::vector<std::string> output = {"positions", "normals"};
  double budget_ms = 0, fps = 60;
  size_t frames = kDefaultFrames, characters = 1, workers = 1;
  int core = -1;
  bool contact = false, pipelined = false, cold = false, contend = false, project = false, json = false;
};

// Throws for what cannot be drawn together.
Drawn DrawnOf(const Options& options) {
  const auto asks = [&](const char* what) {
    return std::find(options.output.begin(), options.output.end(), what) != options.output.end();
  };
  Drawn drawn = {.flags = 0, .normals = asks("normals"), .tangents = asks("tangents"), .half = asks("half")};
  if (asks("coarse")) drawn.flags |= DCLOTH_OUTPUT_COARSE;
  if (asks("textured")) drawn.flags |= DCLOTH_OUTPUT_TEXTURED;
  if (options.contact) drawn.flags |= DCLOTH_OUTPUT_OUTSIDE_BODY;
  const auto refuse = [](const char* found, const char* expected, const char* mend) {
    throw converter::Error({.path = {}, .tensor = {}, .found = found, .expected = expected, .mend = mend});
  };
  if (drawn.tangents && !drawn.normals)
    refuse("--output tangents without normals", "both: tangents are made from normals", "add normals to --output");
  if (asks("coarse") && asks("textured"))
    refuse("--output coarse,textured", "one of them: the coarse mesh has no seams", "leave one out");
  if (asks("coarse") && options.contact)
    refuse("--output coarse with --contact", "one of them: contact moves the whole garment", "leave one out");
  return drawn;
}

// The triangles of the mesh that is compared with the truth, and which of the garment's vertices it has; null: all.
struct Compared {
  std::span<const uint16_t> triangles;
  const uint16_t* vertices;
  size_t vertex_count;
};

Compared ComparedOf(const converter::OpenModel& model, const Drawn& drawn) {
  const dcloth_model_info& info = model.info();
  if ((drawn.flags & DCLOTH_OUTPUT_COARSE) == 0) return {model.triangles(), nullptr, info.vertex_count};
  return {
      {info.coarse_triangles, size_t{3} * info.coarse_triangle_count}, info.coarse_vertices, info.coarse_vertex_count};
}

class Profiler {
 public:
  Profiler(const Options& options, const converter::OpenModel& model, const converter::Sequence& sequence)
      : options_(options),
        sequence_(sequence),
        poses_(sequence, model.joint_names()),
        player_(model, options.stages.empty() ? model.info().stages : converter::ParseStages(options.stages),
                converter::PathText(options.sequence), DrawnOf(options)),
        compared_(ComparedOf(model, DrawnOf(options))),
        meter_(compared_.triangles, compared_.vertex_count),
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
  void Round(bool first, Profile* profile) {
    player_.Reset();
    for (size_t f = 0; f < frame_count_; ++f) {
      const double seconds = static_cast<double>(f) / options_.fps;
      poses_.At(seconds, pose_);
      player_.SetWind(poses_.WindAt(seconds));
      if (evictor_ && !first) player_.Cool(pose_, &*evictor_);
      const ProfiledFrame frame = Time();
      if (first) Compare(seconds);
      if (first || f == 0) continue;
      if (IsInterrupted(frame.tick_ns + frame.skin_ns, frame.work_ns)) {
        profile->interrupted_ms.push_back(FrameMs(frame));
      } else {
        profile->frames.push_back(frame);
      }
    }
  }

  converter::MeshError error() const { return meter_.Result(); }
  uint32_t stages() const { return player_.stages(); }

 private:
  // One frame in two calls, so that ticks and drawing are told apart: an update without drawing, then one
  // without time.
  ProfiledFrame Time() {
    const uint32_t flags = options_.pipelined ? DCLOTH_FRAME_PIPELINED : 0;
    ProfiledFrame frame;
    const uint64_t worked = ThreadNanoseconds();
    frame.start_ns = NowNanoseconds();
    frame.ticks = player_.Update(pose_, static_cast<float>(1 / options_.fps), flags, false, timer_.get());
    const uint64_t ticked = NowNanoseconds();
    const TimedParts tick = timer_.Take();
    frame.tick_steps = tick.steps;
    const uint64_t skin_start = NowNanoseconds();
    player_.Update(pose_, 0, flags, true, timer_.get());
    const uint64_t drawn = NowNanoseconds();
    frame.work_ns = ThreadNanoseconds() - worked;
    frame.skin_ns = drawn - skin_start;
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
    const std::span<const float> truth = sequence_.FrameTruth(static_cast<size_t>(nearest));
    std::vector<float> drawn = player_.ReadPositions(), kept(truth.begin(), truth.end());
    drawn.resize(3 * compared_.vertex_count);  // what repeats others at seams comes last
    if (compared_.vertices != nullptr) {
      for (size_t i = 0; i < drawn.size(); ++i) kept[i] = truth[size_t{3} * compared_.vertices[i / 3] + i % 3];
      kept.resize(drawn.size());
    }
    meter_.AddFrame(drawn, kept);
  }

  const Options& options_;
  const converter::Sequence& sequence_;
  PoseTrack poses_;
  Player player_;
  Compared compared_;
  converter::ErrorMeter meter_;
  std::vector<float> pose_;
  PartTimer timer_;
  size_t frame_count_;
  std::optional<CacheEvictor> evictor_;
};

// A budget that was missed.
int Missed(size_t missed, size_t frames, double budget_ms) {
  if (missed == 0) return kExitGood;
  std::fprintf(stderr, "dcloth: %zu of %zu frames missed the budget of %g ms\n", missed, frames, budget_ms);
  return kExitThresholdMissed;
}

int RunCrowd(const Options& options, const converter::OpenModel& model, const converter::Sequence& sequence,
             std::vector<int> cores) {
  CrowdOptions crowd = {.source = converter::PathText(options.sequence),
                        .characters = options.characters,
                        .workers = options.workers,
                        .frames = options.frames,
                        .stages = options.stages.empty() ? model.info().stages : converter::ParseStages(options.stages),
                        .drawn = DrawnOf(options),
                        .fps = options.fps,
                        .budget_ms = options.budget_ms,
                        .cores = {}};
  // The last core first, as for one character.
  std::reverse(cores.begin(), cores.end());
  if (options.core >= 0) {
    std::erase(cores, options.core);
    cores.insert(cores.begin(), options.core);
  }
  if (options.workers > options.characters || (!cores.empty() && options.workers > cores.size())) {
    throw converter::Error({.path = {},
                            .tensor = {},
                            .found = "--workers " + std::to_string(options.workers),
                            .expected = "a core and a character for each",
                            .mend = "pass --workers 1, or allow this process more cores"});
  }
  cores.resize(std::min(cores.size(), options.workers));
  crowd.cores = std::move(cores);
  const CrowdProfile profile = ProfileCrowd(model, sequence, crowd);
  size_t frames = 0;
  for (const CrowdWorker& worker : profile.workers) frames += worker.frame_ms.size();
  if (options.json) {
    Json json = CrowdJson(profile);
    json["garment"] = model.info().name;
    json["precision"] = model.info().precision;
    json["cpu"] = CpuName();
    json["isa"] = dcloth_isa_name();
    json["output"] = options.output;
    json["contact"] = options.contact;
    json["model_bytes"] = model.bytes().size();
    json["instance_bytes"] = model.instance_bytes();
    PrintJson(json);
  } else {
    PrintCrowd(profile);
  }
  return Missed(profile.missed_frames(), frames, options.budget_ms);
}

int RunProfile(const Options& options) {
  CommandFiles files;
  files.Reads("the model", options.model);
  files.Reads("the sequence", options.sequence);
  files.Writes("--trace", options.trace);
  files.Check();
  const converter::OpenModel model = OpenModelFile(options.model);
  const converter::Sequence sequence = converter::ReadSequence(options.sequence);
  const std::vector<int> cores = AllowedCores();
  if (options.characters > 1) return RunCrowd(options, model, sequence, cores);
  Profile profile;
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
    profiler.Round(true, &profile);  // first touch of pages and code; not counted
    Progress progress("profiling");
    do {
      profiler.Round(false, &profile);
      progress.Step(std::min(profile.frames.size(), options.frames), options.frames);
    } while (profile.frames.size() < options.frames &&
             profile.interrupted_ms.size() < kMostInterrupted * options.frames);
    if (profile.frames.empty()) {
      throw converter::Error({.path = {},
                              .tensor = {},
                              .found = std::to_string(profile.interrupted_ms.size()) + " frames, all interrupted",
                              .expected = "a core on which a frame can run without something else",
                              .mend = "stop what else runs there, or choose another one with --core"});
    }
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
  profile.contact = options.contact;
  profile.output = options.output;
  profile.stages = StagesName(profiler.stages());
  profile.error = profiler.error();
  if (!options.trace.empty()) WriteTrace(options.trace, profile);
  if (options.json) {
    PrintJson(ProfileJson(profile));
  } else {
    PrintProfile(profile);
  }
  return Missed(profile.missed_frames(), profile.frames.size(), options.budget_ms);
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
  command->add_option("--stages", options->stages, "static, skeleton or mesh. Default: all that the model holds");
  command
      ->add_option("--output", options->output,
                   "what is drawn, with commas: positions, normals, tangents, half (16-bit floats), textured (with "
                   "vertices of seams), coarse (half of the vertices)")
      ->delimiter(',')
      ->check(CLI::IsMember({"positions", "normals", "tangents", "half", "textured", "coarse"}))
      ->capture_default_str();
  CLI::Option* const characters =
      command
          ->add_option("--characters", options->characters,
                       "a crowd of so many, planned by a scene on each worker; --budget-ms is each worker's")
          ->check(NumberWithin(1, 1000))
          ->capture_default_str();
  command->add_option("--workers", options->workers, "threads, each on its own core, that share the characters")
      ->check(NumberWithin(1, 2))
      ->needs(characters)
      ->capture_default_str();
  command->add_flag("--contact", options->contact, "keep the garment outside of the body");
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
  for (const char* alone : {"--pipelined", "--cold", "--contend", "--project", "--trace"})
    characters->excludes(command->get_option(alone));
  command->callback([options, &exit_code] { exit_code = RunProfile(*options); });
}

}  // namespace dcloth::tools
