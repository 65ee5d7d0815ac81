// `dcloth body`: the skinned body of a character, in its bind pose, as training reads it.
#include <algorithm>
#include <array>
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
#include "tools/path_check.h"

namespace dcloth::tools {
namespace {

constexpr uint64_t kMaxWeights = uint64_t{1} << 30;

struct Options {
  std::filesystem::path character, output, map;
  std::vector<std::string> meshes;
  SpaceOptions space;
};

struct Body {
  std::vector<float> positions, weights;  // [b, 3], [b, J]
  std::vector<int32_t> faces;             // [c, 3]
};

Body Gather(const CharacterFile& file, const Options& options, const CharacterSpace& space,
            const std::vector<size_t>& nodes) {
  Body body;
  std::vector<size_t> joint_of(file.nodes.size(), nodes.size());
  for (size_t j = 0; j < nodes.size(); ++j) joint_of[nodes[j]] = j;
  std::string held;
  std::vector<bool> used(options.meshes.size());
  for (const SkinnedMesh& mesh : file.meshes) {
    held += (held.empty() ? "'" : ", '") + mesh.name + "'";
    const auto wanted = std::ranges::find(options.meshes, mesh.name);
    if (!options.meshes.empty() && wanted == options.meshes.end()) continue;
    if (wanted != options.meshes.end()) used[static_cast<size_t>(wanted - options.meshes.begin())] = true;
    const size_t first = body.positions.size() / 3, count = first + mesh.positions.size();
    if (count * nodes.size() > kMaxWeights) {
      throw converter::Error(
          {.path = file.path,
           .tensor = {},
           .found = std::to_string(count) + " vertices with " + std::to_string(nodes.size()) + " joints",
           .expected = "at most 2^30 weights",
           .mend = "choose the meshes under the garment with --mesh"});
    }
    for (const Eigen::Vector3d& position : mesh.positions) {
      const Eigen::Vector3d point = space.Point(position);
      for (int a = 0; a < 3; ++a) body.positions.push_back(static_cast<float>(point[a]));
    }
    for (const uint32_t corner : mesh.triangles) body.faces.push_back(static_cast<int32_t>(first + corner));
    body.weights.resize(count * nodes.size());
    std::vector<float> sum(mesh.positions.size());
    for (const SkinInfluence& influence : mesh.influences) sum[influence.vertex] += influence.weight;
    const auto endless = std::ranges::find_if_not(sum, [](float weights) { return std::isfinite(weights); });
    if (endless != sum.end()) {
      throw converter::Error({.path = file.path,
                              .tensor = {},
                              .found = "vertex " + std::to_string(endless - sum.begin()) + " of mesh '" + mesh.name +
                                       "' with weights that add up to infinity",
                              .expected = "weights with a finite sum",
                              .mend = "normalize them, or leave the mesh out with --mesh"});
    }
    for (const SkinInfluence& influence : mesh.influences) {
      body.weights[(first + influence.vertex) * nodes.size() + joint_of[influence.node]] +=
          influence.weight / sum[influence.vertex];
    }
    if (const auto loose = std::ranges::find(sum, 0.0f); loose != sum.end()) {
      throw converter::Error(
          {.path = file.path,
           .tensor = {},
           .found = "vertex " + std::to_string(loose - sum.begin()) + " of mesh '" + mesh.name + "' without a bone",
           .expected = "a weight for every vertex",
           .mend = "weight it, or leave the mesh out with --mesh"});
    }
  }
  for (size_t i = 0; i < used.size(); ++i) {
    if (used[i]) continue;
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "no skinned mesh '" + options.meshes[i] + "'",
                            .expected = held.empty() ? "a skinned mesh" : "one of " + held,
                            .mend = {}});
  }
  if (body.faces.empty()) {
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "no skinned surface",
                            .expected = "a mesh with bones and weights",
                            .mend = "export the body with its skin (BVH has none)"});
  }
  return body;
}

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
  const JointMap map = options.map.empty() ? JointMap{} : ReadJointMap(options.map);
  const CharacterFile file = ReadCharacter(options.character, true);
  const std::vector<std::string> joints = JointsOf(file, map);
  const std::vector<size_t> nodes = FindJoints(file, map, joints);
  std::vector<Eigen::Matrix4d> rest;
  {
    const std::vector<Eigen::Matrix4d> all = RestMatrices(file);
    for (const size_t node : nodes) rest.push_back(all[node]);
  }
  const CharacterSpace space = SpaceOf(file, options.space, rest);
  for (Eigen::Matrix4d& joint : rest) joint = space.World(joint);
  const Body body = Gather(file, options, space, nodes);
  const Retarget unscaled(file, joints, rest, Target{});
  std::vector<float> bind;
  std::vector<int32_t> parents;
  for (size_t j = 0; j < nodes.size(); ++j) {
    const Eigen::Matrix4d matrix = unscaled.Joint(j, rest[j]);
    for (int i = 0; i < 16; ++i) bind.push_back(static_cast<float>(matrix(i / 4, i % 4)));
    int32_t above = file.nodes[nodes[j]].parent;  // the next one above that is a joint
    auto joint = nodes.end();
    while (above >= 0 && joint == nodes.end()) {
      joint = std::ranges::find(nodes, static_cast<size_t>(above));
      above = file.nodes[static_cast<size_t>(above)].parent;
    }
    parents.push_back(joint == nodes.end() ? -1 : static_cast<int32_t>(joint - nodes.begin()));
  }
  using converter::SafeType;
  const uint64_t b = body.positions.size() / 3, joint_count = nodes.size();
  const std::array<converter::SafeTensor, 4> tensors = {{
      {"joint_bind", SafeType::kF32, {joint_count, 4, 4}, std::as_bytes(std::span(bind))},
      {"body_vertices", SafeType::kF32, {b, 3}, std::as_bytes(std::span(body.positions))},
      {"body_weights", SafeType::kF32, {b, joint_count}, std::as_bytes(std::span(body.weights))},
      {"body_faces", SafeType::kI32, {body.faces.size() / 3, 3}, std::as_bytes(std::span(body.faces))},
  }};
  converter::WriteSafetensors(options.output, tensors,
                              {{"joint_names", JsonList(joints)}, {"parents", ParentsText(parents)}});
  std::fprintf(stderr, "%s: %llu vertices, %zu triangles, %zu joints, from a %s file with %g m in a unit\n",
               converter::PathText(options.output).c_str(), static_cast<unsigned long long>(b), body.faces.size() / 3,
               nodes.size(), file.format.c_str(), space.metres_per_unit);
  return kExitGood;
}

}  // namespace

void AddBody(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("body", "Take the skinned body out of a character (glTF, FBX), for training");
  command->add_option("CHARACTER", options->character, "a .glb, .gltf or .fbx file")->required();
  command->add_option("-o,--output", options->output, "the body to write (.safetensors)")->required();
  command->add_option("--map", options->map, "JSON: {\"joint of the garment\": \"node of the file\", ...}");
  command
      ->add_option("--mesh", options->meshes, "a skinned mesh to take; may be repeated; all when not given")
      ->allow_extra_args(false);
  AddSpaceOptions(command, &options->space);
  command->callback([options, &exit_code] { exit_code = WriteBody(*options); });
}

}  // namespace dcloth::tools
