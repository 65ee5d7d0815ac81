// `dcloth dress`: a garment on any character, looked at in a page or carried on as glTF.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <tuple>
#include <utility>

#include "converter/error.h"
#include "converter/file.h"
#include "dcloth/dcloth_fit.h"
#include "tools/character/hero.h"
#include "tools/commands.h"
#include "tools/garment.h"
#include "tools/glb_scene.h"
#include "tools/html_report.h"
#include "tools/import/import.h"
#include "tools/playback.h"
#include "tools/progress.h"
#include "tools/report_scene.h"

namespace dcloth::tools {
namespace {

constexpr size_t kSettleTicks = 30;  // in a clip's first pose, before its first frame
constexpr size_t kStandingSeconds = 3;
constexpr size_t kMostGlbFrames = 600;    // one morph target each
constexpr size_t kMostPageFrames = 3600;  // of all clips
constexpr size_t kPackedFrames = 120;     // of a clip that are packed for the page at once

struct Options {
  std::filesystem::path hero, map;
  std::vector<std::filesystem::path> outputs;
  std::string garment;
  std::vector<std::string> animations;
  SpaceOptions space;
  bool json = false;
};

struct Fitted {
  dcloth_fit fit{};
  converter::AlignedBytes storage;  // begins with the fit, which the cloth uses from now on
};

// What a .glb holds of its one clip.
struct Recording {
  std::vector<float> poses;    // [frames, joints, 16]
  std::vector<float> garment;  // [frames, n, 3]
};

// What the engine tells a host to do, as a user of this command does it. Its texts begin so.
struct Advice {
  const char* engine;
  const char* command;
};
constexpr Advice kAdvice[] = {
    {"set the space", "give the file's up axis: --up z, or --up y"},
    {"left and right are swapped",
     "left and right are swapped in the joints' names: name them in a file for --map; or give the file's up axis: "
     "--up"},
    {"the space says", "give the file's unit: --unit cm, or metres per unit"},
    {"pass matrices", "export the character in its bind pose, with bones of a scale other than 0"},
    {"pass the T or A pose", "export the character in the T or A pose that its skin was bound in"},
};

std::string AdviceOf(const std::string& engine) {
  for (const Advice& advice : kAdvice) {
    if (engine.starts_with(advice.engine)) return advice.command;
  }
  return engine;
}

Fitted FitGarment(const Options& options, const Hero& hero, const converter::OpenModel& model) {
  Fitted fitted;
  std::vector<const char*> names;
  const dcloth_character character = CharacterOf(hero, &names);
  fitted.storage.resize(dcloth_fit_storage_size(model.model(), &character));
  fitted.fit.struct_size = sizeof(fitted.fit);
  dcloth_error error{};
  error.struct_size = sizeof(error);
  if (dcloth_cloth_fit(model.cloth(), &character, fitted.storage.data(), fitted.storage.size(), &fitted.fit, &error) !=
      DCLOTH_OK) {
    const auto part = [&](uint16_t at, uint16_t size) { return std::string(error.text + at, size); };
    const bool joints = error.status == DCLOTH_ERROR_JOINTS;
    std::string mend = AdviceOf(part(error.mend_at, error.mend_size));
    std::string allowed = part(error.allowed_at, error.allowed_size);
    if (const std::string space = "the way up of dcloth_cloth_set_space, "; allowed.starts_with(space))
      allowed.erase(0, space.size());
    if (joints) {
      mend =
          "name them in a file, {\"left upper leg\": \"node of the file\", ...}, and give it with --map; the file's "
          "joints are";
      for (size_t j = 0; j < std::min<size_t>(hero.joints.size(), 80); ++j) mend += " '" + hero.joints[j] + "'";
    }
    throw converter::Error({.path = options.hero,
                            .tensor = {},
                            .found = part(error.found_at, error.found_size),
                            .expected = allowed,
                            .mend = mend});
  }
  return fitted;
}

std::vector<HeroClip> ReadClips(const Options& options, const CharacterFile& file, const Hero& hero, double fps) {
  std::vector<HeroClip> clips;
  for (const std::string& animation : options.animations) clips.push_back(ReadAnimation(animation, file, hero, fps));
  if (clips.empty() && !file.clips.empty()) clips.push_back(FirstClip(file, hero, fps));
  if (clips.empty()) clips.push_back(StandStill(hero, fps, static_cast<size_t>(fps * kStandingSeconds)));
  return clips;
}

// `frame` gets each frame's pose and the garment in it.
template <typename Frame>
void Play(const converter::OpenModel& model, const HeroClip& clip, const std::filesystem::path& source,
          const Frame& frame) {
  Player player(model, model.info().stages, converter::PathText(source), {.flags = DCLOTH_OUTPUT_OUTSIDE_BODY});
  Progress progress("playing " + clip.name);
  player.Reset();
  std::vector<float> pose = clip.pose(0);
  for (size_t k = 0; k < kSettleTicks; ++k) player.Tick(pose);
  for (size_t f = 0; f < clip.frames; ++f) {
    if (f > 0) pose = clip.pose(f);
    player.Tick(pose);
    player.Skin(pose, 1);
    frame(std::span<const float>(pose), player.positions());
    progress.Step(f + 1, clip.frames);
  }
}

// The hero's skin with its pictures and colours. Triangles go by their material; a corner is a vertex of its own where
// its neighbours show another place of the picture or another colour.
ReportBody PicturedBody(const CharacterFile& file, const Hero& hero) {
  ReportBody body;
  body.pictures = file.pictures;
  std::vector<size_t> order(hero.materials.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::ranges::stable_sort(order, {}, [&](size_t t) { return hero.materials[t]; });
  constexpr std::array<uint8_t, 3> kWhite = {UINT8_MAX, UINT8_MAX, UINT8_MAX};
  std::map<std::tuple<uint32_t, float, float, std::array<uint8_t, 3>>, uint32_t> corners;
  std::vector<uint32_t> first(hero.positions.size() / 3, UINT32_MAX);
  for (const size_t t : order) {
    const Material material =
        hero.materials[t] < file.materials.size() ? file.materials[hero.materials[t]] : Material();
    const bool begins = body.faces.empty() || hero.materials[t] != hero.materials[order[body.faces.size() / 3 - 1]];
    if (begins) body.parts.push_back({body.faces.size(), 0, material.colour, material.picture, material.cut_out});
    body.parts.back().count += 3;
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t v = hero.triangles[3 * t + k];
      const float* at = hero.texture_coordinates.data() + 2 * (3 * t + k);
      std::array<uint8_t, 3> colour = kWhite;
      if (!hero.colours.empty()) std::copy_n(hero.colours.data() + 3 * (3 * t + k), 3, colour.begin());
      const auto next = static_cast<uint32_t>(body.same.size());
      const auto [known, fresh] = corners.try_emplace({v, at[0], at[1], colour}, next);
      body.faces.push_back(known->second);
      if (!fresh) continue;
      if (first[v] == UINT32_MAX) first[v] = next;
      body.same.push_back(first[v]);
      for (size_t i = 0; i < 3; ++i) body.positions.push_back(hero.positions[3 * size_t{v} + i]);
      for (size_t i = 0; i < 4; ++i) {
        body.joints.push_back(static_cast<uint16_t>(hero.influences[4 * size_t{v} + i]));
        body.weights.push_back(hero.weights[4 * size_t{v} + i]);
      }
      body.texture_coordinates.insert(body.texture_coordinates.end(), at, at + 2);
      if (!hero.colours.empty()) body.colours.insert(body.colours.end(), colour.begin(), colour.end());
    }
  }
  return body;
}

Report EmptyPage(const Options& options, const converter::OpenModel& model, const CharacterFile& file, const Hero& hero,
                 const dcloth_fit& fit) {
  Report report;
  report.title = std::string(model.info().name) + " on " + converter::PathText(options.hero.stem());
  char line[200];
  std::snprintf(line, sizeof line, "%.2f times the size it was trained at; %.1f mm from the skin where it lies closest",
                static_cast<double>(fit.scale), static_cast<double>(fit.gap_mm));
  report.subtitle = line;
  report.vertex_count = model.info().vertex_count;
  report.facts = {std::string("dcloth ") + dcloth_version(), std::to_string(report.vertex_count) + " vertices",
                  std::to_string(hero.joints.size()) + " joints"};
  report.joint_count = hero.joints.size();
  report.triangles.assign(model.triangles().begin(), model.triangles().end());
  if (!hero.positions.empty()) report.body = PicturedBody(file, hero);
  return report;
}

// Appends frames of a clip to the page's last sequence.
class PageClip {
 public:
  PageClip(const Hero& hero, const HeroClip& clip, Report* report) : skinned_(report->body.has_value()) {
    for (size_t at = 0; at < hero.bind.size(); at += 16) {
      inverse_.push_back(Eigen::Map<const RowMajor>(hero.bind.data() + at).cast<double>().inverse());
    }
    sequence_ = &report->sequences.emplace_back();
    sequence_->name = clip.name;
    sequence_->fps = clip.fps;
    sequence_->tracks.push_back({.name = "cloth", .values = {}});
    sequence_->joints.reserve(clip.frames * inverse_.size() * 12);
    parents_ = SpatialParents(report->triangles, report->vertex_count);
  }

  void Append(std::span<const float> pose, std::span<const float> garment) {
    const double n = static_cast<double>(garment.size()) / 3;
    Eigen::Vector3d center = Eigen::Vector3d::Zero();
    for (size_t i = 0; i < garment.size(); ++i) center[static_cast<Eigen::Index>(i % 3)] += double{garment[i]} / n;
    const Eigen::Vector3f point = center.cast<float>();
    AppendOrigin(std::span(point.data(), 3), sequence_);
    Track& track = sequence_->tracks.back();
    AppendFrame(garment, LastOrigin(*sequence_), &track);
    if (track.values.size() == kPackedFrames * garment.size()) PackFrames(parents_, sequence_->tracks);
    for (size_t j = 0; j < inverse_.size(); ++j) {
      RowMajor joint = Eigen::Map<const RowMajor>(pose.data() + 16 * j);
      // G P^-1 skins the body; without one, sticks are drawn between joints in the world.
      if (skinned_) joint = (joint.cast<double>() * inverse_[j]).cast<float>();
      sequence_->joints.insert(sequence_->joints.end(), joint.data(), joint.data() + 12);
    }
  }

 private:
  using RowMajor = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  bool skinned_;
  std::vector<Eigen::Matrix4d> inverse_;
  std::vector<int32_t> parents_;
  ReportSequence* sequence_;
};

GlbScene SceneOf(const Hero& hero, const converter::OpenModel& model, const HeroClip& clip,
                 const Recording& recording) {
  const dcloth_model_info& info = model.info();
  const size_t drawn = info.textured_vertex_count, corners = size_t{3} * info.triangle_count;
  return {.name = clip.name,
          .fps = clip.fps,
          .frame_count = clip.frames,
          .garment = recording.garment,
          .garment_triangles = drawn == 0 ? model.triangles() : std::span(info.textured_triangles, corners),
          .seam_vertices = {info.seam_vertices, info.seam_vertex_count},
          .texture_coordinates = {info.texture_coordinates, 2 * drawn},
          .joints = hero.joints,
          .bind = hero.bind,
          .poses = recording.poses,
          .body = hero.positions,
          .influences = hero.influences,
          .weights = hero.weights,
          .body_triangles = hero.triangles};
}

struct Warning {
  uint32_t bit;
  const char* name;
  const char* text;
};
constexpr Warning kWarnings[] = {
    {DCLOTH_FIT_STAND_IN, "stand_in",
     "the skeleton lacks a joint that the garment knows; its neighbour moves that part"},
    {DCLOTH_FIT_PROPORTIONS, "proportions", "a bone is shorter than 0.75 or longer than 1.33 of the scaled figure's"},
    {DCLOTH_FIT_STANCE, "stance", "a limb of the bind pose stands far from the figure's T-pose"},
    {DCLOTH_FIT_GIRTH, "girth", "waist or hips are under 0.8 or over 1.25 of the scaled figure's"},
    {DCLOTH_FIT_GAP, "gap",
     "where it lies closest, the garment is more than 15 mm further from the skin than in training"},
    {DCLOTH_FIT_PENETRATION, "penetration", "skin stands more than 5 mm out of the garment somewhere, at rest"},
    {DCLOTH_FIT_FACING, "facing", "no toes: a swap of left and right would not be noticed"},
};

Json FitJson(const Options& options, const converter::OpenModel& model, const Hero& hero, const dcloth_fit& fit,
             std::span<const HeroClip> clips) {
  Json roles = Json::object(), ratios = Json::object(), warnings = Json::array(), played = Json::array();
  for (uint32_t role = 1; dcloth_role_name(role) != nullptr; ++role) {
    if (fit.joints[role] >= 0) roles[dcloth_role_name(role)] = hero.joints[static_cast<size_t>(fit.joints[role])];
    if (fit.ratios[role] != 0) ratios[dcloth_role_name(role)] = fit.ratios[role];
  }
  for (const Warning& warning : kWarnings) {
    if ((fit.warnings & warning.bit) != 0) warnings.push_back(warning.name);
  }
  for (const HeroClip& clip : clips) played.push_back({{"name", clip.name}, {"frames", clip.frames}});
  return {{"hero", converter::PathText(options.hero)},
          {"garment", model.info().name},
          {"joints", roles},
          {"fit",
           {{"scale", fit.scale},
            {"bone_scale", fit.bone_scale},
            {"waist_ratio", fit.waist_ratio},
            {"hips_ratio", fit.hips_ratio},
            {"gap_mm", fit.gap_mm},
            {"penetration_mm", fit.penetration_mm},
            {"penetrating_share", fit.penetrating_share},
            {"stance_degrees", fit.stance_degrees},
            {"stance_role", dcloth_role_name(fit.stance_role)},
            {"bone_ratios", ratios},
            {"warnings", warnings}}},
          {"clips", played}};
}

void PrintFit(const converter::OpenModel& model, const Hero& hero, const dcloth_fit& fit) {
  const auto number = [](float value) { return static_cast<double>(value); };
  uint32_t found = 0;
  for (uint32_t role = 1; dcloth_role_name(role) != nullptr; ++role) found += fit.joints[role] >= 0 ? 1 : 0;
  std::printf("joints  %u of 22 parts of the body found by name among %zu joints\n", found, hero.joints.size());
  std::printf("stance  bind pose within %.0f degrees of the garment's (%s)\n", number(fit.stance_degrees),
              dcloth_role_name(fit.stance_role));
  std::printf("size    %s drawn at %.3f times the size it was trained at (by bones %.3f)\n", model.info().name,
              number(fit.scale), number(fit.bone_scale));
  if (!hero.positions.empty()) {
    if (fit.waist_ratio != 0 || fit.hips_ratio != 0) {
      std::printf("girth   waist %.2f, hips %.2f of the figure's at the size by bones\n", number(fit.waist_ratio),
                  number(fit.hips_ratio));
    }
    std::printf(
        "at rest %.1f mm from the skin where it lies closest; skin at most %.1f mm out of it, at %.1f %% of vertices\n",
        number(fit.gap_mm), number(fit.penetration_mm), 100 * number(fit.penetrating_share));
  }
  for (const Warning& warning : kWarnings) {
    if ((fit.warnings & warning.bit) != 0) std::fprintf(stderr, "warning: %s\n", warning.text);
  }
}

// The first of the outputs with this ending, if there is one.
const std::filesystem::path* OutputWith(const Options& options, const char* extension) {
  const auto found = std::ranges::find_if(
      options.outputs, [&](const std::filesystem::path& output) { return output.extension() == extension; });
  return found == options.outputs.end() ? nullptr : &*found;
}

// Before anything is played: what a page or a glTF file cannot hold.
void CheckLengths(const Options& options, std::span<const HeroClip> clips) {
  const auto at_most = [](const std::filesystem::path* output, size_t frames, size_t most, const std::string& each) {
    if (output == nullptr || frames <= most) return;
    throw converter::Error({.path = *output,
                            .tensor = {},
                            .found = std::to_string(frames) + " frames",
                            .expected = "at most " + std::to_string(most) + each,
                            .mend = "choose a shorter clip with --animation"});
  };
  at_most(OutputWith(options, ".glb"), clips.front().frames, kMostGlbFrames, ", one morph target each");
  size_t frames = 0;
  for (const HeroClip& clip : clips) frames += clip.frames;
  at_most(OutputWith(options, ".html"), frames, kMostPageFrames, " of all clips on a page");
}

int Dress(const Options& options) {
  CommandFiles files;
  files.Reads("the character", options.hero);
  files.Reads("the file of --map", options.map);
  for (const std::filesystem::path& output : options.outputs) files.Writes("-o", output);
  files.Check();
  for (const std::filesystem::path& output : options.outputs) {
    const std::string extension = output.extension().string();
    if (extension == ".html" || extension == ".glb" || extension == ".dcloth-fit") continue;
    throw converter::Error({.path = output,
                            .tensor = {},
                            .found = "output ending '" + extension + "'",
                            .expected = ".html, .glb or .dcloth-fit",
                            .mend = "give the output one of these endings"});
  }
  if (const auto code = InChild(options.hero)) return *code;
  const converter::OpenModel model = OpenGarment(options.garment);
  const JointMap map = options.map.empty() ? JointMap{} : ReadJointMap(options.map);
  std::optional<Progress> reading(std::in_place, "reading " + converter::PathText(options.hero));
  reading->Step(0, 4);
  const CharacterFile file = ReadCharacter(options.hero, true);
  reading->Step(1, 4);
  const Hero hero = ReadHero(file, map, options.space);
  reading->Step(2, 4);
  const Fitted fitted = FitGarment(options, hero, model);
  reading->Step(3, 4);
  const std::vector<HeroClip> clips = ReadClips(options, file, hero, TickRate(model));
  reading.reset();
  if (!options.json) PrintFit(model, hero, fitted.fit);
  CheckLengths(options, clips);
  const bool wants_page = OutputWith(options, ".html") != nullptr, wants_glb = OutputWith(options, ".glb") != nullptr;
  Report page = wants_page ? EmptyPage(options, model, file, hero, fitted.fit) : Report();
  Recording recording;
  for (const HeroClip& clip : clips) {
    const bool records = wants_glb && &clip == &clips.front();
    if (!wants_page && !records) break;
    std::optional<PageClip> on_page;
    if (wants_page) on_page.emplace(hero, clip, &page);
    Play(model, clip, options.hero, [&](std::span<const float> pose, std::span<const float> garment) {
      if (on_page) on_page->Append(pose, garment);
      if (!records) return;
      recording.poses.insert(recording.poses.end(), pose.begin(), pose.end());
      recording.garment.insert(recording.garment.end(), garment.begin(), garment.end());
    });
  }
  const Json json = FitJson(options, model, hero, fitted.fit, clips);
  for (const std::filesystem::path& output : options.outputs) {
    const std::string extension = output.extension().string();
    if (extension == ".html") {
      WriteHtmlReport(output, &page);
    } else if (extension == ".glb") {
      const std::string bytes = GlbBytes(SceneOf(hero, model, clips.front(), recording));
      converter::WriteFileAtomically(output, std::as_bytes(std::span(bytes)));
    } else {
      converter::WriteFileAtomically(output, std::as_bytes(std::span(fitted.storage).first(fitted.fit.file_bytes)));
    }
    std::fprintf(stderr, "%s: %zu clip%s\n", converter::PathText(output).c_str(), clips.size(),
                 clips.size() == 1 ? "" : "s");
  }
  if (options.json) PrintJson(json);
  return kExitGood;
}

}  // namespace

void AddDress(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("dress", "Put a garment on a character (glTF, VRM, FBX) and show it");
  command->add_option("HERO", options->hero, "a rigged character: .glb, .gltf, .vrm or .fbx")->required();
  command->add_option("--garment", options->garment, "skirt, robe, a .dcloth model or a training bundle")->required();
  command
      ->add_option("--animation", options->animations,
                   "a clip of the character's by name or number, or a file (CLIPS.glb#NAME chooses in it) with the\n"
                   "character's skeleton; may be repeated. The first clip of the character when not given")
      ->allow_extra_args(false);
  command->add_option("--map", options->map, "JSON: {\"left upper leg\": \"node of the file\", ...}");
  command
      ->add_option(
          "-o,--output", options->outputs,
          "OUT.html: a page with the character in the garment; OUT.glb: the same as an animation (first clip);\n"
          "OUT.dcloth-fit: the fit, which games read with dcloth_cloth_set_fit. May be repeated")
      ->required()
      ->allow_extra_args(false);
  command->add_flag("--json", options->json, "print the fit as one JSON object");
  AddSpaceOptions(command, &options->space);
  command->callback([options, &exit_code] { exit_code = Dress(*options); });
}

}  // namespace dcloth::tools
