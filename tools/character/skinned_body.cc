#include "tools/character/skinned_body.h"

#include <algorithm>
#include <cmath>

#include "converter/error.h"
#include "tools/character/matrix_values.h"
#include "tools/character/skeleton.h"

namespace dcloth::tools {
namespace {

constexpr uint64_t kMaxWeights = uint64_t{1} << 30;

void AddMesh(const CharacterFile& file, const SkinnedMesh& mesh, const Skeleton& skeleton,
             std::span<const size_t> joint_of, SkinnedBody* body) {
  const size_t joint_count = skeleton.nodes.size();
  const size_t first = body->positions.size() / 3, count = first + mesh.positions.size();
  const auto refuse = [&](const std::string& found, const std::string& expected, const std::string& mend) {
    throw converter::Error({.path = file.path, .tensor = {}, .found = found, .expected = expected, .mend = mend});
  };
  const auto vertex = [&](auto at, const auto& of) {
    return "vertex " + std::to_string(at - of.begin()) + " of mesh '" + mesh.name + "'";
  };
  if (count * joint_count > kMaxWeights) {
    refuse(std::to_string(count) + " vertices with " + std::to_string(joint_count) + " joints", "at most 2^30 weights",
           "choose the meshes under the garment with --mesh");
  }
  for (const Eigen::Vector3d& position : mesh.positions) {
    const Eigen::Vector3f point = skeleton.space.Point(position).cast<float>();
    if (!point.allFinite()) RefuseNumbers(file, "a vertex of mesh '" + mesh.name + "'");
    body->positions.insert(body->positions.end(), point.begin(), point.end());
  }
  for (const uint32_t corner : mesh.triangles) body->faces.push_back(static_cast<int32_t>(first + corner));
  body->weights.resize(count * joint_count);
  std::vector<float> sum(mesh.positions.size());
  for (const SkinInfluence& influence : mesh.influences) sum[influence.vertex] += influence.weight;
  if (const auto endless = std::ranges::find_if_not(sum, [](float weights) { return std::isfinite(weights); });
      endless != sum.end()) {
    refuse(vertex(endless, sum) + " with weights that add up to infinity", "weights with a finite sum",
           "normalize them, or leave the mesh out with --mesh");
  }
  for (const SkinInfluence& influence : mesh.influences) {
    const size_t joint = joint_of[influence.node];
    if (joint == joint_count) {
      refuse("mesh '" + mesh.name + "' with weights of '" + file.nodes[influence.node].name + "', which is no joint",
             "weights of joints", "weight it to bones, or leave the mesh out with --mesh");
    }
    body->weights[(first + influence.vertex) * joint_count + joint] += influence.weight / sum[influence.vertex];
  }
  if (const auto loose = std::ranges::find(sum, 0.0f); loose != sum.end()) {
    refuse(vertex(loose, sum) + " without a bone", "a weight for every vertex",
           "weight it, or leave the mesh out with --mesh");
  }
}

void AddMeshes(const CharacterFile& file, std::span<const std::string> meshes, const Skeleton& skeleton,
               std::span<const size_t> joint_of, SkinnedBody* body) {
  std::string held;
  std::vector<bool> used(meshes.size());
  for (const SkinnedMesh& mesh : file.meshes) {
    held += (held.empty() ? "'" : ", '") + mesh.name + "'";
    const auto wanted = std::ranges::find(meshes, mesh.name);
    if (!meshes.empty() && wanted == meshes.end()) continue;
    if (wanted != meshes.end()) used[static_cast<size_t>(wanted - meshes.begin())] = true;
    AddMesh(file, mesh, skeleton, joint_of, body);
  }
  for (size_t i = 0; i < used.size(); ++i) {
    if (used[i]) continue;
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "no skinned mesh '" + meshes[i] + "'",
                            .expected = held.empty() ? "a skinned mesh" : "one of " + held,
                            .mend = {}});
  }
  if (body->faces.empty()) {
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "no skinned surface",
                            .expected = "a mesh with bones and weights",
                            .mend = "export the body with its skin (BVH has none)"});
  }
}

}  // namespace

SkinnedBody SkinnedBodyOf(const CharacterFile& file, std::span<const std::string> meshes, const Skeleton& skeleton) {
  const std::vector<size_t>& nodes = skeleton.nodes;
  std::vector<size_t> joint_of(file.nodes.size(), nodes.size());  // nodes.size(): no joint
  for (size_t j = 0; j < nodes.size(); ++j) joint_of[nodes[j]] = j;
  SkinnedBody body;
  AddMeshes(file, meshes, skeleton, joint_of, &body);
  const Retarget unscaled(file, skeleton, {});
  for (size_t j = 0; j < nodes.size(); ++j) {
    if (!AppendMatrix(unscaled.Joint(j, skeleton.rest[j]), &body.bind)) {
      RefuseNumbers(file, "joint '" + skeleton.joints[j] + "' at rest");
    }
    int32_t above = file.nodes[nodes[j]].parent;
    while (above >= 0 && joint_of[static_cast<size_t>(above)] == nodes.size()) {
      above = file.nodes[static_cast<size_t>(above)].parent;
    }
    body.parents.push_back(above < 0 ? -1 : static_cast<int32_t>(joint_of[static_cast<size_t>(above)]));
  }
  return body;
}

}  // namespace dcloth::tools
