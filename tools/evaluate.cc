// `dcloth evaluate`: speed and error of every precision on motion with known truth, as table, JSON and page.
#include <algorithm>
#include <array>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>

#include "converter/error.h"
#include "tools/baseline.h"
#include "tools/commands.h"
#include "tools/evaluate_output.h"
#include "tools/html_report.h"
#include "tools/machine.h"
#include "tools/report_scene.h"

namespace dcloth::tools {
namespace {

// Of each variant of the grid: its median counts, and there are many.
constexpr size_t kGridColdTicks = 60;

struct Options {
  std::filesystem::path bundle, html;
  std::vector<std::filesystem::path> sequences, calibration;
  std::vector<std::string> precisions;
  std::vector<uint32_t> ranks;
  bool pareto = false, json = false;
};

// Collects what the page shows while the variants play.
class Scene {
 public:
  Scene(const converter::Bundle& bundle, std::span<const converter::Sequence> sequences)
      : bundle_(bundle), sequences_(sequences), inverse_bind_(InverseBind(bundle)) {
    for (const converter::Sequence& s : sequences) report_.sequences.push_back(Start(s));
  }

  void Add(const Played& played) {
    // "int8/skeleton" plays as "skeleton": one track a stage.
    const size_t slash = played.variant.find('/');
    const std::string name = slash == std::string::npos ? played.variant : played.variant.substr(slash + 1);
    ReportSequence& out = report_.sequences[played.sequence];
    const converter::Sequence& sequence = sequences_[played.sequence];
    out.tracks.push_back(MakeTrack(name, out, [&](size_t t) { return Frame(played.positions, t); }));
    if (!sequence.has_truth()) return;
    const size_t step = FramesPerTick(bundle_, sequence);
    std::vector<double> errors;
    for (size_t t = 0; t < out.origins.size() / 3; ++t) {
      errors.push_back(MeanDistanceMm(Frame(played.positions, t), sequence.FrameTruth(t * step)));
    }
    out.error_mm.emplace_back(name, std::move(errors));
  }

  Report Finish(Json variants, std::string isa) {
    const size_t faces = static_cast<size_t>(bundle_.template_faces.size());
    report_.title = bundle_.garment;
    report_.subtitle =
        "Learned cloth on one CPU thread, measured on motion with known truth: speed, memory and error in the same "
        "row.";
    report_.cpu = CpuName();
    report_.facts = {std::string("dcloth ") + dcloth_version(),
                     CpuName(),
                     "instruction set " + std::move(isa),
                     "one thread",
                     std::to_string(bundle_.vertex_count()) + " vertices",
                     std::to_string(faces / 3) + " triangles"};
    report_.joint_count = bundle_.joint_names.size();
    report_.vertex_count = bundle_.vertex_count();
    std::transform(bundle_.template_faces.data(), bundle_.template_faces.data() + faces,
                   std::back_inserter(report_.triangles), [](int32_t i) { return static_cast<uint16_t>(i); });
    report_.body = BodyOf(bundle_);
    report_.variants = std::move(variants);
    return std::move(report_);
  }

 private:
  std::span<const float> Frame(std::span<const float> positions, size_t tick) const {
    const size_t size = size_t{bundle_.vertex_count()} * 3;
    return positions.subspan(tick * size, size);
  }

  template <typename FrameOf>
  Track MakeTrack(const std::string& name, const ReportSequence& sequence, FrameOf frame_of) const {
    Track track{.name = name, .values = {}};
    for (size_t t = 0; t < sequence.origins.size() / 3; ++t) {
      AppendFrame(frame_of(t), std::span(sequence.origins).subspan(3 * t, 3), &track);
    }
    return track;
  }

  ReportSequence Start(const converter::Sequence& sequence) const {
    ReportSequence out;
    out.name = converter::PathText(sequence.path.stem());
    out.fps = bundle_.tick_rate;
    const PoseTrack poses(sequence, bundle_.joint_names);
    const size_t step = FramesPerTick(bundle_, sequence), joints = bundle_.joint_names.size();
    std::vector<float> matrices(joints * 12);
    for (size_t t = 0; t < TickCount(bundle_, sequence); ++t) {
      const std::span<const float> pose = poses.Frame(t * step);
      const float* hips = &pose[16 * size_t{bundle_.hips}];
      AppendOrigin(std::array<float, 3>{hips[3], hips[7], hips[11]}, &out);
      SkinningMatrices(inverse_bind_, pose, matrices);
      out.joints.insert(out.joints.end(), matrices.begin(), matrices.end());
    }
    if (sequence.has_truth()) {
      out.tracks.push_back(MakeTrack("truth", out, [&](size_t t) { return sequence.FrameTruth(t * step); }));
    }
    return out;
  }

  const converter::Bundle& bundle_;
  std::span<const converter::Sequence> sequences_;
  std::vector<double> inverse_bind_;
  Report report_;
};

// A rank is fitted to the calibration motion: what it costs shows on other motion only.
void CheckGrid(const Options& options) {
  const auto usage = [](std::string found, std::string mend) {
    throw converter::Error(
        {.path = {}, .tensor = {}, .found = std::move(found), .expected = {}, .mend = std::move(mend)});
  };
  if (!options.ranks.empty() && options.calibration.empty()) {
    usage("--rank without motion to fit a smaller basis to", "add --calibrate SEQ, once or more");
  }
  for (const std::filesystem::path& calibration : options.calibration) {
    for (const std::filesystem::path& sequence : options.sequences) {
      if (!IsSameFile(calibration, sequence)) continue;
      usage(converter::PathText(sequence) + " both to calibrate and to evaluate on",
            "calibrate on other motion, or a smaller basis is judged by what it was fitted to");
    }
  }
}

int RunEvaluate(const Options& options) {
  CheckGrid(options);
  CommandFiles files;
  files.Reads("the bundle", options.bundle);
  files.Reads("a sequence", options.sequences);
  files.Reads("a sequence of --calibrate", options.calibration);
  files.Writes("--html", options.html);
  files.Check();
  const converter::Bundle bundle = converter::ReadBundle(options.bundle);
  std::vector<converter::Sequence> sequences;
  for (const std::filesystem::path& path : options.sequences) sequences.push_back(converter::ReadSequence(path));
  for (const converter::Sequence& s : sequences) FramesPerTick(bundle, s);
  std::vector<converter::Sequence> calibration;
  for (const std::filesystem::path& path : options.calibration) calibration.push_back(converter::ReadSequence(path));

  EvaluationOptions evaluation;
  evaluation.pareto = options.pareto;
  evaluation.ranks = options.ranks;
  evaluation.calibration = calibration;
  if (options.pareto) evaluation.cold_ticks = kGridColdTicks;
  for (const std::string& name : options.precisions) {
    const converter::Precision precision = *converter::ParsePrecision(name);
    auto& list = evaluation.precisions;
    if (std::find(list.begin(), list.end(), precision) == list.end()) list.push_back(precision);
  }
  std::optional<Scene> scene;
  if (!options.html.empty()) scene.emplace(bundle, sequences);
  const std::vector<Variant> variants = Evaluate(bundle, sequences, evaluation, [&](const Played& played) {
    if (scene) scene->Add(played);
  });

  const Json rows = VariantsJson(variants);
  if (scene) {
    Report report = scene->Finish(rows, dcloth_isa_name());
    WriteHtmlReport(options.html, &report);
  }
  if (options.json) {
    PrintJson({{"version", dcloth_version()},
               {"bundle", converter::PathText(options.bundle)},
               {"garment", bundle.garment},
               {"vertices", bundle.vertex_count()},
               {"tick_rate", bundle.tick_rate},
               {"cpu", CpuName()},
               {"isa", dcloth_isa_name()},
               {"variants", rows},
               {"pareto", ParetoJson(variants)},
               {"sequences", SequencesJson(variants, sequences, bundle)}});
  }
  PrintVariants(variants, options.json ? stderr : stdout);
  if (scene) std::fprintf(stderr, "%s: open it in a browser\n", converter::PathText(options.html).c_str());
  return kExitGood;
}

}  // namespace

void AddEvaluate(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("evaluate", "Measure speed and error of a bundle on sequences");
  command->footer(
      "tick_ms is one tick plus skinning with normals, on one thread, with the model and the cloth dropped from the "
      "caches\n"
      "before every tick. tick_warm_ms is the same without that. Errors are distances to the truth. Recorded and "
      "scripted clips (\"procedural/...\") "
      "have a table\n"
      "each. The first 12 frames of a clip do not count. \"of motion\" is the error divided by how far the truth "
      "moves. fp32 is the\n"
      "difference to the float32 engine.\n"
      "Rows: the garment fixed rigidly to the hips; plain skinning (weights of the nearest body point, no network); "
      "the last\n"
      "precision stopped after each earlier stage (\"int8/static\"); each precision with all stages; and the last "
      "precision kept\n"
      "outside of the body (\"int8/outside\"), if the bundle's skin collides.\n"
      "A variant is dominated if another one is neither slower (cold p50) nor less accurate (E_d, in steps of 0.01 "
      "mm), and is\n"
      "better in one of them. --pareto adds all combinations of precision, rank and stages: \"int8@64/skeleton\" has a "
      "basis of 64\n"
      "rows and stops after the skeleton stage.");
  command->add_option("BUNDLE", options->bundle, "a training bundle (.safetensors)")->required();
  command->add_option("SEQ", options->sequences, "sequences (.safetensors)")->required();
  command->add_option("--precision", options->precisions, "fp32, fp16 or int8; may be repeated. Default: all three")
      ->allow_extra_args(false)
      ->check(CLI::IsMember({"fp32", "fp16", "int8"}));
  command->add_flag("--pareto", options->pareto,
                    "also measure all combinations of precision, rank and stages, and mark the dominated ones");
  command
      ->add_option("--rank", options->ranks,
                   "with --pareto: rows of a smaller displacement basis to measure; may be repeated. Default: a half, "
                   "a quarter and\n"
                   "an eighth of the full basis")
      ->allow_extra_args(false)
      ->check(NumberWithin(1, std::numeric_limits<uint32_t>::max()))
      ->needs("--pareto");
  command
      ->add_option("--calibrate", options->calibration,
                   "with --pareto: a sequence that smaller bases are fitted to; may be repeated. Do not use one of SEQ")
      ->allow_extra_args(false)
      ->needs("--pareto");
  AddIsaOption(command);
  command->add_flag("--json", options->json, "one JSON object on stdout");
  command->add_option("--html", options->html,
                      "also write a self-contained page with the table, plots and the garment in 3D");
  command->callback([options, &exit_code] {
    if (options->precisions.empty()) options->precisions = {"fp32", "fp16", "int8"};
    exit_code = RunEvaluate(*options);
  });
}

}  // namespace dcloth::tools
