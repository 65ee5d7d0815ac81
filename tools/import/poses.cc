// `dcloth poses`: an animation of glTF, FBX or BVH as a sequence.
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>

#include "converter/error.h"
#include "converter/safetensors.h"
#include "tools/import/commands.h"
#include "tools/import/in_child.h"
#include "tools/import/joint_map.h"
#include "tools/import/retarget.h"
#include "tools/import/space_options.h"
#include "tools/number_check.h"
#include "tools/path_check.h"

namespace dcloth::tools {
namespace {

constexpr double kDefaultRate = 30;  // what training simulates at
constexpr uint64_t kMaxBytes = uint64_t{4} << 30;
constexpr double kWorthAWord = 0.02;  // metres between two skeletons at rest

struct Options {
  std::filesystem::path animation, output, map, model;
  std::string clip;
  double fps = 0;  // 0: the model's tick rate
  SpaceOptions space;
};

const CharacterClip& ChooseClip(const CharacterFile& file, const std::string& wanted) {
  std::string held;
  for (size_t i = 0; i < file.clips.size(); ++i) {
    if (!wanted.empty() && (file.clips[i].name == wanted || std::to_string(i) == wanted)) return file.clips[i];
    held += (i == 0 ? "'" : ", '") + file.clips[i].name + "'";
  }
  if (wanted.empty() && file.clips.size() == 1) return file.clips.front();
  throw converter::Error({.path = file.path,
                          .tensor = {},
                          .found = file.clips.empty() ? "no animation" : "the clips " + held,
                          .expected = wanted.empty() ? "one clip" : "a clip '" + wanted + "'",
                          .mend = file.clips.empty() ? "export the character with its animation, baked to keys"
                                                     : "choose one with --clip NAME, or by its number from 0"});
}

std::string NumberText(double value) {
  char text[32];
  char* const end = std::to_chars(text, text + sizeof(text), value).ptr;
  return {text, end};
}

int Poses(const Options& options) {
  CommandFiles files;
  files.Reads("the animation", options.animation);
  files.Reads("the file of --map", options.map);
  files.Reads("the file of --model", options.model);
  files.Writes("-o", options.output);
  files.Check();
  if (const auto code = InChild(options.animation)) return *code;
  const Target target = options.model.empty() ? Target{} : ReadTarget(options.model);
  const JointMap map = options.map.empty() ? JointMap{} : ReadJointMap(options.map);
  const CharacterFile file = ReadCharacter(options.animation, false);
  const CharacterClip& clip = ChooseClip(file, options.clip);
  const std::vector<std::string> joints = options.model.empty() ? JointsOf(file, map) : target.joint_names;
  const std::vector<size_t> nodes = FindJoints(file, map, joints);
  if (nodes.empty()) {
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "neither bones nor animated nodes",
                            .expected = "a skeleton",
                            .mend = "export the armature too"});
  }
  std::vector<Eigen::Matrix4d> rest;
  {
    const std::vector<Eigen::Matrix4d> all = RestMatrices(file);
    for (const size_t node : nodes) rest.push_back(all[node]);
  }
  const CharacterSpace space = SpaceOf(file, options.space, rest);
  for (Eigen::Matrix4d& joint : rest) joint = space.World(joint);
  const Retarget retarget(file, joints, rest, target);

  const double fps = options.fps > 0 ? options.fps : target.tick_rate > 0 ? target.tick_rate : kDefaultRate;
  const double frames = std::floor((clip.last_seconds - clip.first_seconds) * fps + 1e-3) + 1;
  if (frames * static_cast<double>(nodes.size()) * 64 > static_cast<double>(kMaxBytes)) {
    throw converter::Error(
        {.path = file.path,
         .tensor = {},
         .found = std::to_string(clip.last_seconds - clip.first_seconds) + " s at " + NumberText(fps) + " Hz",
         .expected = "a sequence of at most 4 GB",
         .mend = "cut the clip or lower --fps"});
  }
  const auto frame_count = static_cast<size_t>(frames);
  std::vector<float> matrices;
  matrices.reserve(frame_count * nodes.size() * 16);
  for (size_t f = 0; f < frame_count; ++f) {
    const auto world = WorldMatrices(file, &clip, clip.first_seconds + static_cast<double>(f) / fps);
    for (size_t j = 0; j < nodes.size(); ++j) {
      const Eigen::Matrix4d joint = retarget.Joint(j, space.World(world[nodes[j]]));
      for (int i = 0; i < 16; ++i) matrices.push_back(static_cast<float>(joint(i / 4, i % 4)));
      if (!joint.allFinite()) {
        throw converter::Error(
            {.path = file.path,
             .tensor = {},
             .found = "numbers out of range at joint '" + joints[j] + "', frame " + std::to_string(f),
             .expected = "finite matrices",
             .mend = "the file is damaged"});
      }
    }
  }
  const std::array<converter::SafeTensor, 1> tensors = {{{"joint_matrices",
                                                          converter::SafeType::kF32,
                                                          {frame_count, nodes.size(), 4, 4},
                                                          std::as_bytes(std::span(matrices))}}};
  converter::WriteSafetensors(options.output, tensors,
                              {{"joint_names", JsonList(joints)},
                               {"fps", NumberText(fps)},
                               {"clip", converter::PathText(options.animation.stem())},
                               {"kind", "dynamic"}});
  std::fprintf(stderr, "%s: %zu frames at %g Hz, %zu joints, from clip '%s' of a %s file with %g m in a unit\n",
               converter::PathText(options.output).c_str(), frame_count, fps, nodes.size(),
               converter::PathText(clip.name).c_str(), file.format.c_str(), space.metres_per_unit);
  if (retarget.farthest_metres() > kWorthAWord) {
    std::fprintf(stderr,
                 "note: at rest joint '%s' is %.0f mm from its place in the garment's bind pose; the garment learned "
                 "another body\n",
                 joints[retarget.farthest_joint()].c_str(), 1e3 * retarget.farthest_metres());
  }
  return kExitGood;
}

}  // namespace

void AddPoses(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("poses", "Turn an animation (glTF, FBX, BVH) into a sequence");
  command->add_option("ANIMATION", options->animation, "a .glb, .gltf, .fbx or .bvh file")->required();
  command->add_option("-o,--output", options->output, "the sequence to write (.safetensors)")->required();
  command->add_option("--map", options->map, "JSON: {\"joint of the garment\": \"node of the file\", ...}");
  command->add_option("--model", options->model,
                      "whose joints are wanted: a .dcloth model, or a bundle or character (.safetensors), which also\n"
                      "say how each joint's axes lie in the bind pose; every bone when not given");
  command->add_option("--fps", options->fps, "frames per second; the model's tick rate when not given, else 30")
      ->check(NumberWithin(1, 1000));
  command->add_option("--clip", options->clip, "name or number (from 0) of the clip, where a file holds several");
  AddSpaceOptions(command, &options->space);
  command->callback([options, &exit_code] { exit_code = Poses(*options); });
}

}  // namespace dcloth::tools
