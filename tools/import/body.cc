// `dcloth body`: the skinned body of a character, in its bind pose, as training reads it.
#include <array>
#include <cstdio>
#include <memory>
#include <optional>

#include "converter/error.h"
#include "converter/safetensors.h"
#include "tools/character/skinned_body.h"
#include "tools/commands.h"
#include "tools/import/import.h"
#include "tools/progress.h"

namespace dcloth::tools {
namespace {

struct Options {
  std::filesystem::path character, output, map;
  std::vector<std::string> meshes;
  SpaceOptions space;
};

std::string ParentsText(const std::vector<int32_t>& parents) {
  std::string text;
  for (const int32_t parent : parents) text += (text.empty() ? "[" : ",") + std::to_string(parent);
  return text + "]";
}

int WriteBody(const Options& options) {
  CommandFiles files;
  files.Reads("the character", options.character);
  files.Reads("the file of --map", options.map);
  files.Writes("-o", options.output);
  files.Check();
  if (const auto code = InChild(options.character)) return *code;
  std::optional<Progress> reading(std::in_place, "reading " + converter::PathText(options.character));
  reading->Step(0, 1);
  const JointMap map = options.map.empty() ? JointMap{} : ReadJointMap(options.map);
  const CharacterFile file = ReadCharacter(options.character, true);
  const Skeleton skeleton = SkeletonOf(file, map, {}, options.space);
  const SkinnedBody body = SkinnedBodyOf(file, options.meshes, skeleton);
  reading.reset();
  using converter::SafeType;
  const uint64_t b = body.positions.size() / 3, joint_count = skeleton.nodes.size();
  const std::array<converter::SafeTensor, 4> tensors = {{
      {"joint_bind", SafeType::kF32, {joint_count, 4, 4}, std::as_bytes(std::span(body.bind))},
      {"body_vertices", SafeType::kF32, {b, 3}, std::as_bytes(std::span(body.positions))},
      {"body_weights", SafeType::kF32, {b, joint_count}, std::as_bytes(std::span(body.weights))},
      {"body_faces", SafeType::kI32, {body.faces.size() / 3, 3}, std::as_bytes(std::span(body.faces))},
  }};
  converter::WriteSafetensors(options.output, tensors,
                              {{"joint_names", JsonList(skeleton.joints)}, {"parents", ParentsText(body.parents)}});
  std::fprintf(stderr, "%s: %llu vertices, %zu triangles, %zu joints, from a %s file with %g m in a unit\n",
               converter::PathText(options.output).c_str(), static_cast<unsigned long long>(b), body.faces.size() / 3,
               skeleton.nodes.size(), file.format.c_str(), skeleton.space.metres_per_unit);
  return kExitGood;
}

}  // namespace

void AddBody(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("body", "Extract the skinned body of a character (glTF, FBX) for training");
  command->add_option("CHARACTER", options->character, "a .glb, .gltf or .fbx file")->required();
  command->add_option("-o,--output", options->output, "the body to write (.safetensors)")->required();
  command->add_option("--map", options->map, "JSON: {\"joint of the garment\": \"node of the file\", ...}");
  command->add_option("--mesh", options->meshes, "a skinned mesh to take; may be repeated. Default: all")
      ->allow_extra_args(false);
  AddSpaceOptions(command, &options->space);
  command->callback([options, &exit_code] { exit_code = WriteBody(*options); });
}

}  // namespace dcloth::tools
