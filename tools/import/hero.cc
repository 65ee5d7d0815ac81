// `dcloth hero`: a character, its roles and its clips as training simulates a garment on them.
#include "tools/character/hero.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>

#include "converter/error.h"
#include "converter/safetensors.h"
#include "tools/commands.h"
#include "tools/import/import.h"
#include "tools/progress.h"

namespace dcloth::tools {
namespace {

constexpr double kTrainingRate = 30;
constexpr size_t kInfluences = 4;

struct Options {
  std::filesystem::path hero, output, map;
  std::string animation;
  double fps = kTrainingRate;
  SpaceOptions space;
};

std::string Numbers(std::span<const int32_t> values) {
  std::string text;
  for (const int32_t value : values) text += (text.empty() ? "[" : ",") + std::to_string(value);
  return text.empty() ? "[]" : text + "]";
}

// The joint above each one, -1 at the top; nodes that are no joints are stepped over.
std::vector<int32_t> ParentsOf(const CharacterFile& file, const Hero& hero) {
  std::vector<int32_t> joint_of(file.nodes.size(), -1), parents;
  for (size_t j = 0; j < hero.nodes.size(); ++j) joint_of[hero.nodes[j]] = static_cast<int32_t>(j);
  for (const size_t node : hero.nodes) {
    int32_t above = file.nodes[node].parent;
    while (above >= 0 && joint_of[static_cast<size_t>(above)] < 0)
      above = file.nodes[static_cast<size_t>(above)].parent;
    parents.push_back(above < 0 ? -1 : joint_of[static_cast<size_t>(above)]);
  }
  return parents;
}

std::vector<std::string> RolesOf(const CharacterFile& file, const Hero& hero) {
  const std::vector<uint32_t> by_node = NodeRoles(file);
  std::vector<std::string> roles;
  for (size_t j = 0; j < hero.joints.size(); ++j) {
    const uint32_t told = hero.roles[j];
    roles.emplace_back(dcloth_role_name(told != DCLOTH_ROLE_NONE ? told : by_node[hero.nodes[j]]));
  }
  return roles;
}

void WriteHero(const Options& options, const CharacterFile& file, const Hero& hero) {
  if (hero.triangles.empty()) {
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "no skinned surface",
                            .expected = "a mesh with bones and weights",
                            .mend = "export the body with its skin"});
  }
  std::vector<std::string> meshes, clips;
  std::vector<int32_t> mesh_of;
  for (const SkinnedMesh& mesh : file.meshes) {
    mesh_of.insert(mesh_of.end(), mesh.positions.size(), static_cast<int32_t>(meshes.size()));
    meshes.push_back(mesh.name);
  }
  for (const CharacterClip& clip : file.clips) clips.push_back(clip.name);
  using converter::SafeType;
  const uint64_t b = hero.positions.size() / 3, joint_count = hero.joints.size();
  const std::array<converter::SafeTensor, 6> tensors = {{
      {"joint_bind", SafeType::kF32, {joint_count, 4, 4}, std::as_bytes(std::span(hero.bind))},
      {"body_vertices", SafeType::kF32, {b, 3}, std::as_bytes(std::span(hero.positions))},
      {"body_joints", SafeType::kI32, {b, kInfluences}, std::as_bytes(std::span(hero.influences))},
      {"body_weights", SafeType::kF32, {b, kInfluences}, std::as_bytes(std::span(hero.weights))},
      {"body_faces", SafeType::kI32, {hero.triangles.size() / 3, 3}, std::as_bytes(std::span(hero.triangles))},
      {"body_mesh", SafeType::kI32, {b}, std::as_bytes(std::span(mesh_of))},
  }};
  converter::WriteSafetensors(options.output, tensors,
                              {{"joint_names", JsonList(hero.joints)},
                               {"parents", Numbers(ParentsOf(file, hero))},
                               {"roles", JsonList(RolesOf(file, hero))},
                               {"meshes", JsonList(meshes)},
                               {"clips", JsonList(clips)}});
  std::fprintf(stderr, "%s: %llu vertices, %zu triangles, %zu joints, %zu clips\n",
               converter::PathText(options.output).c_str(), static_cast<unsigned long long>(b),
               hero.triangles.size() / 3, hero.joints.size(), clips.size());
}

void WriteClip(const Options& options, const Hero& hero, const HeroClip& clip) {
  constexpr uint64_t kMostBytes = uint64_t{2} << 30;
  if (clip.frames > kMostBytes / (64 * hero.joints.size())) {
    throw converter::Error({.path = options.hero,
                            .tensor = {},
                            .found = "clip '" + clip.name + "' of " + std::to_string(clip.frames) + " frames",
                            .expected = "a clip whose poses take at most 2 GB",
                            .mend = "shorten the clip or lower --fps"});
  }
  std::vector<float> matrices;
  for (size_t f = 0; f < clip.frames; ++f) {
    const std::vector<float> pose = clip.pose(f);
    matrices.insert(matrices.end(), pose.begin(), pose.end());
  }
  const std::array<converter::SafeTensor, 1> tensors = {{{"joint_matrices",
                                                          converter::SafeType::kF32,
                                                          {clip.frames, hero.joints.size(), 4, 4},
                                                          std::as_bytes(std::span(matrices))}}};
  char rate[32];
  std::snprintf(rate, sizeof rate, "%.9g", options.fps);
  converter::WriteSafetensors(
      options.output, tensors,
      {{"joint_names", JsonList(hero.joints)}, {"fps", rate}, {"clip", clip.name}, {"kind", "dynamic"}});
  std::fprintf(stderr, "%s: %zu frames at %s Hz, clip '%s'\n", converter::PathText(options.output).c_str(), clip.frames,
               rate, converter::PrintableText(clip.name).c_str());
}

int RunHero(const Options& options) {
  CommandFiles files;
  files.Reads("the character", options.hero);
  files.Reads("the file of --map", options.map);
  files.Writes("-o", options.output);
  files.Check();
  if (const auto code = InChild(options.hero)) return *code;
  std::optional<Progress> reading(std::in_place, "reading " + converter::PathText(options.hero));
  reading->Step(0, 1);
  const JointMap map = options.map.empty() ? JointMap{} : ReadJointMap(options.map);
  const CharacterFile file = ReadCharacter(options.hero, true);
  const Hero hero = ReadHero(file, map, options.space);
  std::optional<HeroClip> clip;
  if (!options.animation.empty()) clip = ReadAnimation(options.animation, file, hero, options.fps);
  reading.reset();
  if (clip) {
    WriteClip(options, hero, *clip);
  } else {
    WriteHero(options, file, hero);
  }
  return kExitGood;
}

}  // namespace

void AddHero(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("hero", "Extract a character, or a clip on it, for simulating a garment");
  command->add_option("HERO", options->hero, "a rigged character: .glb, .gltf, .vrm or .fbx")->required();
  command->add_option("-o,--output", options->output, "what to write (.safetensors)")->required();
  command->add_option("--animation", options->animation,
                      "write this clip's poses instead: a clip of the character's by name or number, or a file\n"
                      "(CLIPS.glb#NAME chooses in it) with the same kind of skeleton");
  command->add_option("--fps", options->fps, "of the poses. Default: 30")->check(NumberWithin(1, 1000));
  command->add_option("--map", options->map, "JSON: {\"left upper leg\": \"node of the file\", ...}");
  AddSpaceOptions(command, &options->space);
  command->callback([options, &exit_code] { exit_code = RunHero(*options); });
}

}  // namespace dcloth::tools
