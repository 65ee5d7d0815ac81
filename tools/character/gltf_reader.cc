#include "tools/character/gltf_reader.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "dcloth/dcloth_fit.h"
#include "tools/character/character_pose.h"
#include "tools/character/matrix_values.h"

namespace dcloth::tools {
namespace {

constexpr size_t kMaxNodes = 1 << 16, kMaxDepth = 1024, kMaxClips = 4096;
constexpr size_t kMaxKeys = 1 << 22;  // of one curve
constexpr double kMaxSeconds = 86400;

Eigen::Quaterniond QuaternionOf(const float* xyzw) {
  return {double{xyzw[3]}, double{xyzw[0]}, double{xyzw[1]}, double{xyzw[2]}};
}

bool HasDirection(const Eigen::Quaterniond& rotation) {
  const double length = rotation.norm();
  return length >= 1e-3 && length <= 1e3;  // false for NaN
}

}  // namespace

GltfReader::GltfReader(const std::filesystem::path& path, const tinygltf::Model& model, Folder* folder)
    : model_(model), folder_(folder), values_(file_, model) {
  file_.path = path;
  file_.format = "glTF";
  file_.upright.setIdentity();
  file_.metres_per_unit = 1;
}

// The nodes of the scene that viewers show; without a scene those that no other node has.
std::vector<int> GltfReader::Roots() const {
  if (!model_.scenes.empty()) {
    const int scene = std::max(model_.defaultScene, 0);
    if (static_cast<size_t>(scene) >= model_.scenes.size()) {
      Refuse(file_, "scene " + std::to_string(scene),
             "one of the file's " + std::to_string(model_.scenes.size()) + " scenes", "export it again");
    }
    return model_.scenes[static_cast<size_t>(scene)].nodes;
  }
  std::set<int> children;
  for (const tinygltf::Node& node : model_.nodes) children.insert(node.children.begin(), node.children.end());
  std::vector<int> roots;
  for (int i = 0; i < static_cast<int>(model_.nodes.size()); ++i) {
    if (!children.contains(i)) roots.push_back(i);
  }
  return roots;
}

Eigen::Matrix4d GltfReader::Local(const tinygltf::Node& node, const std::string& name) const {
  const std::string where = "the transform of '" + name + "'";
  for (const auto& [numbers, wanted] : {std::pair(&node.matrix, 16), std::pair(&node.translation, 3),
                                        std::pair(&node.rotation, 4), std::pair(&node.scale, 3)}) {
    if (!numbers->empty() && numbers->size() != static_cast<size_t>(wanted))
      Refuse(file_, std::to_string(numbers->size()) + " numbers in " + where, std::to_string(wanted));
    for (const double number : *numbers) CheckNumber(file_, number, where);
  }
  Eigen::Matrix4d out = Eigen::Matrix4d::Identity();
  if (!node.matrix.empty()) {
    out = Eigen::Map<const Eigen::Matrix4d>(node.matrix.data());  // columns, as Eigen's
    out.row(3) << 0, 0, 0, 1;
    return out;
  }
  if (!node.rotation.empty()) {
    const Eigen::Quaterniond rotation(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
    if (!HasDirection(rotation)) Refuse(file_, "a rotation without a direction in " + where, "unit quaternions");
    out.topLeftCorner<3, 3>() = rotation.normalized().toRotationMatrix();
  }
  if (!node.scale.empty()) {
    out.topLeftCorner<3, 3>() *= Eigen::Vector3d(node.scale[0], node.scale[1], node.scale[2]).asDiagonal();
  }
  if (!node.translation.empty())
    out.topRightCorner<3, 1>() = Eigen::Map<const Eigen::Vector3d>(node.translation.data());
  return out;
}

void GltfReader::ReadNodes() {
  struct Waiting {
    int node;
    int32_t parent;
    size_t depth;
  };
  node_of_.resize(model_.nodes.size());
  std::vector<Waiting> waiting;
  const std::vector<int> roots = Roots();
  for (auto root = roots.rbegin(); root != roots.rend(); ++root) waiting.push_back({*root, -1, 1});
  while (!waiting.empty()) {  // not recursive: a hostile depth must not exhaust the stack
    const Waiting next = waiting.back();
    waiting.pop_back();
    if (next.node < 0 || static_cast<size_t>(next.node) >= model_.nodes.size())
      Refuse(file_, "node " + std::to_string(next.node), "one of the file's " + std::to_string(model_.nodes.size()));
    const tinygltf::Node& from = model_.nodes[static_cast<size_t>(next.node)];
    std::optional<size_t>& index = node_of_[static_cast<size_t>(next.node)];
    if (index) Refuse(file_, "node " + std::to_string(next.node) + " below two nodes", "a tree of nodes");
    if (file_.nodes.size() >= kMaxNodes) Refuse(file_, "too many nodes", "at most " + std::to_string(kMaxNodes));
    if (next.depth > kMaxDepth)
      Refuse(file_, "nodes that are nested too deep", "at most " + std::to_string(kMaxDepth) + " levels");
    index = file_.nodes.size();
    CharacterNode node;
    node.name = from.name.empty() ? "node " + std::to_string(next.node) : from.name;
    node.parent = next.parent;
    node.local = Local(from, node.name);
    rest_.push_back(next.parent < 0 ? node.local
                                    : Eigen::Matrix4d(rest_[static_cast<size_t>(next.parent)] * node.local));
    file_.nodes.push_back(std::move(node));
    from_.push_back(next.node);
    for (auto child = from.children.rbegin(); child != from.children.rend(); ++child)
      waiting.push_back({*child, static_cast<int32_t>(*index), next.depth + 1});
  }
  if (file_.nodes.empty()) Refuse(file_, "no nodes", "a skeleton");
}

std::optional<size_t> GltfReader::NodeOf(int node) const {
  if (node < 0 || static_cast<size_t>(node) >= node_of_.size())
    Refuse(file_, "node " + std::to_string(node), "one of the file's " + std::to_string(node_of_.size()));
  return node_of_[static_cast<size_t>(node)];
}

// glTF allows equal names; a name is one node from here on. Joints keep theirs.
void GltfReader::NameNodes() {
  std::vector<bool> joint(file_.nodes.size());
  const auto mark = [&](int node) {
    if (node >= 0 && static_cast<size_t>(node) < node_of_.size() && node_of_[static_cast<size_t>(node)])
      joint[*node_of_[static_cast<size_t>(node)]] = true;
  };
  for (const tinygltf::Skin& skin : model_.skins) std::ranges::for_each(skin.joints, mark);
  for (const tinygltf::Animation& animation : model_.animations) {
    for (const tinygltf::AnimationChannel& channel : animation.channels) mark(channel.target_node);
  }
  std::map<std::string, size_t> held;
  for (const bool joints : {true, false}) {
    for (size_t i = 0; i < joint.size(); ++i) {
      if (joint[i] != joints) continue;
      std::string& name = file_.nodes[i].name;
      const std::string wanted = name;
      while (++held[name] > 1) name = wanted + " (" + std::to_string(++held[wanted] - 1) + ")";
    }
  }
}

// VRM 0 and 1, and clips of VRM.
void GltfReader::ReadRoles() {
  const auto add = [&](const std::string& bone, const tinygltf::Value& node) {
    const uint32_t role = dcloth_role_of_name(bone.c_str());
    if (role == DCLOTH_ROLE_NONE || !node.IsInt()) return;
    const int index = node.GetNumberAsInt();
    if (index < 0 || static_cast<size_t>(index) >= node_of_.size() || !node_of_[static_cast<size_t>(index)]) return;
    file_.roles.emplace_back(file_.nodes[*node_of_[static_cast<size_t>(index)]].name, role);
  };
  for (const char* const name : {"VRM", "VRMC_vrm", "VRMC_vrm_animation"}) {
    const auto extension = model_.extensions.find(name);
    if (extension == model_.extensions.end() || !extension->second.IsObject()) continue;
    const tinygltf::Value& humanoid = extension->second.Get("humanoid");
    const tinygltf::Value& bones = humanoid.IsObject() ? humanoid.Get("humanBones") : humanoid;
    for (size_t i = 0; bones.IsArray() && i < bones.ArrayLen(); ++i) {
      const tinygltf::Value& bone = bones.Get(static_cast<int>(i));
      if (bone.IsObject() && bone.Get("bone").IsString()) add(bone.Get("bone").Get<std::string>(), bone.Get("node"));
    }
    if (!bones.IsObject()) continue;
    for (const std::string& bone : bones.Keys()) {
      if (bones.Get(bone).IsObject()) add(bone, bones.Get(bone).Get("node"));
    }
  }
}

template <typename Value, typename Make>
void GltfReader::ReadCurve(const tinygltf::AnimationSampler& sampler, const std::string& where, const Make& make,
                           Curve<Value>* to) const {
  constexpr size_t kWidth = sizeof(Value) / sizeof(double);
  if (!to->keys.empty()) Refuse(file_, "a second time " + where, "one channel for each node and path");
  const bool cubic = sampler.interpolation == "CUBICSPLINE";
  to->holds = sampler.interpolation == "STEP";
  if (!cubic && !to->holds && sampler.interpolation != "LINEAR")
    Refuse(file_, "the interpolation '" + sampler.interpolation + "' in " + where, "LINEAR, STEP or CUBICSPLINE");
  const std::vector<float> times = values_.Floats(sampler.input, 1, "the times of " + where);
  const std::vector<float> values = values_.Floats(sampler.output, static_cast<int>(kWidth), "the values of " + where);
  const size_t parts = cubic ? 3 : 1;  // in-tangent, value, out-tangent
  if (times.size() > kMaxKeys) Refuse(file_, "too many keys in " + where, "at most " + std::to_string(kMaxKeys));
  if (values.size() != times.size() * parts * kWidth) {
    Refuse(
        file_,
        std::to_string(values.size() / kWidth) + " values for " + std::to_string(times.size()) + " times in " + where,
        std::to_string(parts) + " for each time");
  }
  for (const float value : values) CheckNumber(file_, double{value}, where);
  double last = -kMaxSeconds;
  for (size_t k = 0; k < times.size(); ++k) {
    const double seconds = double{times[k]};
    if (!(seconds >= last && seconds <= kMaxSeconds))
      Refuse(file_, "a key at " + std::to_string(seconds) + " s in " + where, "increasing times within a day");
    last = seconds;
    const float* const at = values.data() + k * parts * kWidth;
    to->keys.emplace_back(seconds, make(at + (cubic ? kWidth : 0), true));
    if (cubic) to->tangents.push_back({make(at, false), make(at + 2 * kWidth, false)});
  }
}

void GltfReader::ReadClip(const tinygltf::Animation& animation, size_t index) {
  CharacterClip clip;
  clip.name = animation.name.empty() ? "clip " + std::to_string(index) : animation.name;
  std::map<size_t, size_t> channel_of;  // by the file's node
  for (const tinygltf::AnimationChannel& from : animation.channels) {
    const std::string& path = from.target_path;
    if (path != "translation" && path != "rotation" && path != "scale") continue;
    const std::optional<size_t> node = NodeOf(from.target_node);
    if (!node) continue;
    const std::string where = "clip '" + clip.name + "', " + path + " of '" + file_.nodes[*node].name + "'";
    if (from.sampler < 0 || static_cast<size_t>(from.sampler) >= animation.samplers.size())
      Refuse(file_, "sampler " + std::to_string(from.sampler) + " in " + where, "one of the animation's");
    const tinygltf::AnimationSampler& sampler = animation.samplers[static_cast<size_t>(from.sampler)];
    const auto [at, fresh] = channel_of.try_emplace(*node, clip.channels.size());
    if (fresh) clip.channels.push_back({.node = *node});
    NodeChannel& channel = clip.channels[at->second];
    if (path == "rotation") {
      const auto make = [&](const float* xyzw, bool key) {
        const Eigen::Quaterniond value = QuaternionOf(xyzw);
        if (key && !HasDirection(value))
          Refuse(file_, "a rotation without a direction in " + where, "unit quaternions");
        return key ? value.normalized() : value;
      };
      ReadCurve(sampler, where, make, &channel.rotations);
    } else {
      const auto make = [](const float* xyz, bool) {
        return Eigen::Vector3d(double{xyz[0]}, double{xyz[1]}, double{xyz[2]});
      };
      ReadCurve(sampler, where, make, path == "scale" ? &channel.scales : &channel.positions);
    }
  }
  SetSpan(&clip);
  file_.clips.push_back(std::move(clip));
}

CharacterFile GltfReader::Read(bool meshes) {
  ReadNodes();
  NameNodes();
  ReadRoles();
  if (model_.animations.size() > kMaxClips)
    Refuse(file_, std::to_string(model_.animations.size()) + " clips", "at most " + std::to_string(kMaxClips));
  for (size_t i = 0; i < model_.animations.size(); ++i) ReadClip(model_.animations[i], i);
  if (meshes) ReadMaterials();
  std::vector<BoundMesh> bound;
  for (const int node : from_) AddMesh(model_.nodes[static_cast<size_t>(node)], meshes, &bound);
  AddSkins(bound, meshes, &file_);
  return std::move(file_);
}

}  // namespace dcloth::tools
