#include "tests/fuzz/character_use.h"

#include <algorithm>
#include <cmath>

#include "converter/error.h"
#include "tests/unit/engine/all_finite.h"
#include "tools/character/skeleton.h"
#include "tools/character/skinned_body.h"

namespace dcloth::testing {
namespace {

constexpr double kMostFrames = 16;

std::string BrokenFile(const tools::CharacterFile& file) {
  const size_t node_count = file.nodes.size();
  for (size_t i = 0; i < node_count; ++i) {
    const int32_t parent = file.nodes[i].parent;
    if (parent < -1 || parent >= static_cast<int32_t>(i)) return "a parent behind its child";
    if (!file.nodes[i].local.allFinite()) return "a transform that is not finite";
  }
  const auto ascends = [](const auto& keys) {
    return std::ranges::is_sorted(keys.keys, {}, [](const auto& key) { return key.first; });
  };
  for (const tools::CharacterClip& clip : file.clips) {
    for (const tools::NodeChannel& channel : clip.channels) {
      if (channel.node >= node_count) return "a channel of no node";
      if (!ascends(channel.positions) || !ascends(channel.scales) || !ascends(channel.rotations))
        return "keys that do not ascend";
      for (const auto& key : channel.rotations.keys)
        if (!(std::abs(key.second.norm() - 1) < 1e-6)) return "a rotation of another length than 1";
    }
  }
  for (const tools::SkinnedMesh& mesh : file.meshes) {
    for (const uint32_t corner : mesh.triangles)
      if (corner >= mesh.positions.size()) return "a corner of no vertex";
    for (const tools::SkinInfluence& influence : mesh.influences)
      if (influence.vertex >= mesh.positions.size() || influence.node >= node_count || !(influence.weight > 0))
        return "an influence of no vertex or node, or without weight";
  }
  return "";
}

std::string BrokenClips(const tools::CharacterFile& file, const tools::Skeleton& skeleton,
                        const CharacterRequest& asked) {
  const tools::Retarget retarget(file, skeleton, asked.bind);
  for (const tools::CharacterClip& clip : file.clips) {
    const double seconds = clip.last_seconds - clip.first_seconds;
    const double fps = std::min(30.0, (kMostFrames - 1) / std::max(seconds, 1e-6));
    const tools::ClipMatrices matrices = tools::SampleClip(file, clip, skeleton, retarget, fps);
    if (matrices.frame_count == 0 || matrices.values.size() != matrices.frame_count * skeleton.nodes.size() * 16)
      return "matrices of the wrong size";
    if (!AllFinite(matrices.values)) return "joint matrices that are not finite";
  }
  return "";
}

std::string BrokenBody(const tools::CharacterFile& file, const tools::Skeleton& skeleton) {
  const tools::SkinnedBody body = tools::SkinnedBodyOf(file, {}, skeleton);
  const size_t joint_count = skeleton.nodes.size(), vertex_count = body.positions.size() / 3;
  if (body.bind.size() != joint_count * 16 || body.parents.size() != joint_count ||
      body.weights.size() != vertex_count * joint_count)
    return "a body of the wrong size";
  if (!AllFinite(body.bind) || !AllFinite(body.positions)) return "a body that is not finite";
  for (size_t j = 0; j < joint_count; ++j)
    if (body.parents[j] < -1 || body.parents[j] >= static_cast<int32_t>(j)) return "a joint before its parent";
  for (const int32_t corner : body.faces)
    if (corner < 0 || static_cast<size_t>(corner) >= vertex_count) return "a face of no vertex";
  for (size_t v = 0; v < vertex_count; ++v) {
    float sum = 0;
    for (size_t j = 0; j < joint_count; ++j) {
      const float weight = body.weights[v * joint_count + j];
      if (!(weight >= 0)) return "a negative weight";
      sum += weight;
    }
    if (!(std::abs(sum - 1) < 1e-4f)) return "weights that do not add up to 1";
  }
  return "";
}

// What `work` says, or nothing where it refuses with a word.
template <typename Work>
std::string Refusable(const Work& work, bool* accepted) {
  try {
    const std::string broken = work();
    *accepted = true;
    return broken;
  } catch (const converter::Error& error) {
    return *error.what() != '\0' ? "" : "a refusal without a word";
  }
}

}  // namespace

Verdict ReadAndUse(const std::function<tools::CharacterFile()>& read, const CharacterRequest& asked) {
  tools::CharacterFile file;
  bool is_read = false, used = false;
  std::string broken = Refusable(
      [&] {
        file = read();
        return BrokenFile(file);
      },
      &is_read);
  if (!is_read || !broken.empty()) return {broken, false};
  broken = Refusable(
      [&] { return BrokenClips(file, tools::SkeletonOf(file, asked.map, asked.wanted, asked.space), asked); }, &used);
  if (!broken.empty()) return {broken, used};
  broken = Refusable([&] { return BrokenBody(file, tools::SkeletonOf(file, asked.map, {}, asked.space)); }, &used);
  return {broken, used};
}

}  // namespace dcloth::testing
