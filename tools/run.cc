// `dcloth run`: a model over a sequence at any frame rate, written as positions, a point cache or a page to look at.
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <utility>

#include "converter/error.h"
#include "converter/file.h"
#include "converter/model_geometry.h"
#include "converter/sequence.h"
#include "tools/commands.h"
#include "tools/html_report.h"
#include "tools/mesh_files.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/progress.h"
#include "tools/report_scene.h"

namespace dcloth::tools {
namespace {

struct Options {
  std::filesystem::path model, sequence, output, mesh;
  double fps = 0;  // 0: the tick rate
  std::string stages, wind;
  bool outside_body = false;
};

struct Result {
  size_t frame_count = 0;
  std::vector<float> positions;  // [frame_count, n, 3]
};

// "X,Y,Z" in m/s; none where nothing was asked for.
std::optional<std::array<float, 3>> ParseWind(const std::string& text) {
  if (text.empty()) return std::nullopt;
  std::array<float, 3> wind = {};
  const char* at = text.data();
  const char* const end = at + text.size();
  bool read = true;
  for (size_t i = 0; i < 3 && read; ++i) {
    const auto [next, error] = std::from_chars(at, end, wind[i]);
    read = error == std::errc() && (i < 2 ? next != end && *next == ',' : next == end);
    at = i < 2 ? next + 1 : next;
  }
  if (!read || !(std::hypot(double{wind[0]}, double{wind[1]}, double{wind[2]}) <= 100)) {
    throw converter::Error(
        {.path = {},
         .tensor = {},
         .found = "--wind '" + text + "'",
         .expected = "X,Y,Z in m/s: three numbers, a speed of at most 100",
         .mend = "write --wind=0,0,-5, for example: it blows in the face of a character that looks along +Z"});
  }
  return wind;
}

Result Play(const Options& options, const converter::OpenModel& model, const PoseTrack& poses, double fps,
            uint32_t stages) {
  const std::optional<std::array<float, 3>> steady_wind = ParseWind(options.wind);
  // Slower than ticks, more updates than frames: one that runs more than two ticks would skip some.
  const auto updates = static_cast<size_t>(std::max(1.0, std::ceil(TickRate(model) / fps - 1e-6)));
  const double step = 1 / (fps * static_cast<double>(updates));
  Player player(model, stages, converter::PathText(options.sequence),
                {.flags = options.outside_body ? uint32_t{DCLOTH_OUTPUT_OUTSIDE_BODY} : 0});
  std::vector<float> pose(poses.joint_count() * 16);
  Result result;
  result.frame_count = FrameCount(poses, fps, options.sequence);
  result.positions.reserve(result.frame_count * player.positions().size());
  Progress progress("running");
  player.Reset();
  for (size_t f = 0; f < result.frame_count; ++f) {
    for (size_t update = f == 0 ? updates : 1; update <= updates; ++update) {
      const double seconds = (static_cast<double>(f) - 1) / fps + static_cast<double>(update) * step;
      poses.At(seconds, pose);
      player.SetWind(steady_wind.value_or(poses.WindAt(seconds)));
      player.Update(pose, f == 0 ? 0 : static_cast<float>(step), 0, update == updates);
    }
    if (!std::ranges::all_of(player.positions(), [](float x) { return std::isfinite(x); })) {
      throw converter::Error({.path = options.model,
                              .tensor = {},
                              .found = "NaN or infinity in the vertices of frame " + std::to_string(f),
                              .expected = "finite positions",
                              .mend = "check whether training diverged; if it did, train again"});
    }
    result.positions.insert(result.positions.end(), player.positions().begin(), player.positions().end());
    progress.Step(f + 1, result.frame_count);
  }
  return result;
}

// B_j^-1 of each joint.
std::vector<Eigen::Matrix4d> InverseBinds(const converter::OpenModel& model) {
  using RowMajor = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  std::vector<Eigen::Matrix4d> inverses;
  for (uint32_t j = 0; j < model.info().joint_count; ++j) {
    RowMajor bind;
    if (dcloth_model_joint_bind(model.model(), j, bind.data()) != DCLOTH_OK) return {};
    inverses.emplace_back(bind.cast<double>().inverse());
  }
  return inverses;
}

// The model's own body, where it holds one; else sticks between all joints of the sequence, as a model asks for the few
// that it needs, which make no figure.
void WritePage(const Options& options, const converter::OpenModel& model, const converter::Sequence& poses, double fps,
               const Result& result) {
  using RowMajor = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  converter::ModelGeometry geometry = converter::GeometryOf(model.bytes());
  const std::vector<Eigen::Matrix4d> inverses = InverseBinds(model);
  const bool body = !geometry.body.empty() && !inverses.empty();
  const PoseTrack skeleton(poses, body ? model.joint_names() : poses.joint_names);
  const size_t n = model.info().vertex_count, frame_size = n * 3, joints = skeleton.joint_count();
  Report report;
  report.title = model.info().name;
  report.subtitle =
      std::string(model.info().precision) + " model on " + converter::PathText(options.sequence.filename());
  report.facts = {std::string("dcloth ") + dcloth_version(), std::to_string(n) + " vertices"};
  report.joint_count = joints;
  report.triangles.assign(model.triangles().begin(), model.triangles().end());
  report.vertex_count = n;
  if (body) {
    report.body.emplace();
    report.body->positions = std::move(geometry.body);
    report.body->faces = std::move(geometry.body_triangles);
    report.body->joints = std::move(geometry.body_joints);
    report.body->weights = std::move(geometry.body_weights);
  } else {
    report.sticks = SticksOf(skeleton);
  }
  ReportSequence sequence;
  sequence.name = converter::PathText(options.sequence.stem());
  sequence.fps = fps;
  Track track{.name = "cloth", .values = {}};
  std::vector<float> pose(joints * 16);
  for (size_t f = 0; f < result.frame_count; ++f) {
    const auto positions = std::span(result.positions).subspan(f * frame_size, frame_size);
    double center[3] = {0, 0, 0};
    for (size_t i = 0; i < frame_size; ++i) center[i % 3] += positions[i] / static_cast<double>(n);
    const std::array<float, 3> point = {static_cast<float>(center[0]), static_cast<float>(center[1]),
                                        static_cast<float>(center[2])};
    AppendOrigin(point, &sequence);
    AppendFrame(positions, LastOrigin(sequence), &track);
    skeleton.At(static_cast<double>(f) / fps, pose);
    for (size_t j = 0; j < joints; ++j) {
      if (body) {
        Eigen::Map<RowMajor> joint(pose.data() + 16 * j);
        joint = (joint.cast<double>() * inverses[j]).cast<float>().eval();
      }
      sequence.joints.insert(sequence.joints.end(), pose.begin() + static_cast<ptrdiff_t>(16 * j),
                             pose.begin() + static_cast<ptrdiff_t>(16 * j + 12));
    }
  }
  sequence.tracks.push_back(std::move(track));
  report.sequences.push_back(std::move(sequence));
  WriteHtmlReport(options.output, &report);
}

// Animations of artists' files are no sequences yet.
void RefuseAnimation(const Options& options) {
  std::string extension = options.sequence.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  for (const char* kind : {".glb", ".gltf", ".vrm", ".fbx", ".bvh"}) {
    if (extension != kind) continue;
    std::string mend = "make one: dcloth poses ";
    mend.append(converter::PathText(options.sequence))
        .append(" -o ")
        .append(converter::PathText(options.sequence.stem()))
        .append(".safetensors --model ")
        .append(converter::PathText(options.model))
        .append("; for a character of its own: dcloth dress");
    throw converter::Error({.path = options.sequence,
                            .tensor = {},
                            .found = "an animation file (" + extension + ")",
                            .expected = "a sequence (.safetensors)",
                            .mend = std::move(mend)});
  }
}

int Run(const Options& options) {
  CommandFiles files;
  files.Reads("the model", options.model);
  files.Reads("the sequence", options.sequence);
  files.Writes("-o", options.output);
  files.Writes("--mesh", options.mesh);
  files.Check();
  const std::string extension = options.output.extension().string();
  if (extension != ".safetensors" && extension != ".pc2" && extension != ".mdd" && extension != ".html") {
    throw converter::Error({.path = options.output,
                            .tensor = {},
                            .found = "output ending '" + extension + "'",
                            .expected = ".safetensors, .pc2, .mdd or .html",
                            .mend = "name the output accordingly"});
  }
  RefuseAnimation(options);
  const converter::OpenModel model = OpenModelFile(options.model);
  const uint32_t stages = options.stages.empty() ? model.info().stages : ParseStages(options.stages);
  const converter::Sequence sequence = converter::ReadSequence(options.sequence);
  const PoseTrack poses(sequence, model.joint_names());
  const double fps = options.fps > 0 ? options.fps : TickRate(model);
  const Result result = Play(options, model, poses, fps, stages);
  const size_t n = model.info().vertex_count;
  std::optional<converter::PreparedFile> mesh;
  if (!options.mesh.empty()) {
    const converter::ModelGeometry geometry = converter::GeometryOf(model.bytes());
    const std::string text = ObjText(model.info().name, geometry.template_positions, model.triangles());
    mesh.emplace(options.mesh, std::as_bytes(std::span(text)));
  }
  if (extension == ".pc2") {
    WritePc2(options.output, result.positions, result.frame_count, n);
  } else if (extension == ".mdd") {
    WriteMdd(options.output, result.positions, result.frame_count, n, fps);
  } else if (extension == ".html") {
    WritePage(options, model, sequence, fps, result);
  } else {
    converter::WriteRunOutput(options.output, {.garment = model.info().name,
                                               .fps = fps,
                                               .frame_count = result.frame_count,
                                               .vertex_count = n,
                                               .positions = result.positions,
                                               .triangles = model.triangles()});
  }
  if (mesh) mesh->Replace();
  std::fprintf(stderr, "%s: %zu frames at %g Hz, %zu vertices, stages up to %s\n",
               converter::PathText(options.output).c_str(), result.frame_count, fps, n, StagesName(stages));
  return kExitGood;
}

}  // namespace

void AddRun(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("run", "Play a sequence and write the cloth's motion");
  command->add_option("MODEL", options->model, "a .dcloth file")->required();
  command->add_option("SEQ", options->sequence, "a sequence (.safetensors)")->required();
  command->add_option("-o,--output", options->output, "OUT.safetensors, OUT.pc2, OUT.mdd or OUT.html")->required();
  command->add_option(
      "--mesh", options->mesh,
      "also write the garment's mesh (.obj) in the bind pose, for tools that apply a point cache to a mesh");
  command
      ->add_option("--fps", options->fps,
                   "drawn frames per second. Default: the model's tick rate. Frames are drawn as in a game: up to one "
                   "tick late\n"
                   "if the rate is not the tick rate")
      ->check(NumberWithin(1, 1000));
  command->add_option("--stages", options->stages, "static, skeleton or mesh. Default: all that the model holds")
      ->check(CLI::IsMember({"static", "skeleton", "mesh"}));
  command->add_option(
      "--wind", options->wind,
      "X,Y,Z in metres per second: a steady wind instead of the sequence's, for models that read it. Write\n"
      "--wind=-5,0,0 if the first number is negative");
  command->add_flag("--outside-body", options->outside_body, "push vertices out of the body, as a game may");
  command->callback([options, &exit_code] { exit_code = Run(*options); });
}

}  // namespace dcloth::tools
