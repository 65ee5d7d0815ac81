#include "tools/character/assimp_reader.h"

#include <assimp/config.h>
#include <assimp/postprocess.h>

#include <algorithm>
#include <assimp/IOStream.hpp>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <utility>
#include <vector>

#include "converter/error.h"
#include "tools/character/bound_mesh.h"
#include "tools/character/character_pose.h"
#include "tools/character/folder.h"
#include "tools/character/matrix_values.h"
#include "tools/character/memory_limit.h"
#include "tools/character/read_by_assimp.h"

namespace dcloth::tools {
namespace {

constexpr size_t kMaxNodes = 1 << 16, kMaxDepth = 1024, kMaxClips = 4096;
constexpr uint32_t kMaxKeys = 1 << 22;  // of one kind of one node
constexpr double kMaxSeconds = 86400;

// A folder's files as assimp asks for them.
class BytesStream : public Assimp::IOStream {
 public:
  explicit BytesStream(converter::AlignedBytes bytes) : bytes_(std::move(bytes)) {}

  size_t Read(void* buffer, size_t size, size_t count) override {
    if (size == 0) return 0;
    const size_t whole = std::min(count, (bytes_.size() - at_) / size);
    if (whole != 0) std::memcpy(buffer, bytes_.data() + at_, whole * size);
    at_ += whole * size;
    return whole;
  }
  size_t Write(const void*, size_t, size_t) override { return 0; }
  aiReturn Seek(size_t offset, aiOrigin origin) override {
    const size_t base = origin == aiOrigin_CUR ? at_ : origin == aiOrigin_END ? bytes_.size() : 0;
    // From the end, offsets come as negative numbers wrapped around.
    const size_t target = base + offset;
    if (target > bytes_.size()) return aiReturn_FAILURE;
    at_ = target;
    return aiReturn_SUCCESS;
  }
  size_t Tell() const override { return at_; }
  size_t FileSize() const override { return bytes_.size(); }
  void Flush() override {}

 private:
  converter::AlignedBytes bytes_;
  size_t at_ = 0;
};

class AssimpFiles : public Assimp::IOSystem {
 public:
  explicit AssimpFiles(Folder* folder) : folder_(folder) {}

  bool Exists(const char* file) const override { return folder_->Has(file); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override {  // null where not allowed
    if (std::strchr(mode, 'w') != nullptr || std::strchr(mode, 'a') != nullptr) return nullptr;
    auto bytes = folder_->Read(file);
    return bytes ? new BytesStream(std::move(*bytes)) : nullptr;
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }

 private:
  Folder* folder_;
};

}  // namespace

AssimpReader::AssimpReader(const aiScene& scene, const Assimp::IOSystem& files, std::string format,
                           const std::filesystem::path& path)
    : scene_(scene), files_(files) {
  file_.path = path;
  file_.format = std::move(format);
  file_.upright.setIdentity();
}

Eigen::Matrix4d AssimpReader::Matrix(const aiMatrix4x4& matrix, const std::string& where) const {
  Eigen::Matrix4d out;
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) {
      out(r, c) = static_cast<double>(matrix[static_cast<unsigned>(r)][static_cast<unsigned>(c)]);
      CheckNumber(file_, out(r, c), where);
    }
  }
  out.row(3) << 0, 0, 0, 1;
  return out;
}

size_t AssimpReader::NodeOf(const aiString& name, const std::string& where) const {
  const auto found = index_.find(name.C_Str());
  if (found == index_.end()) {
    Refuse(file_, where + " for a node '" + name.C_Str() + "'", "the name of a node in the file",
           "the file is damaged; export it again");
  }
  if (count_.at(found->first) > 1) {
    Refuse(file_,
           std::to_string(count_.at(found->first)) + " nodes called '" + found->first + "', of which " + where +
               " needs one",
           "unique names for bones", "rename the nodes and export again");
  }
  return found->second;
}

void AssimpReader::ReadNodes() {
  struct Waiting {
    const aiNode* node;
    int32_t parent;
    size_t depth;
  };
  if (scene_.mRootNode == nullptr) Refuse(file_, "no nodes", "a skeleton");
  std::vector<Waiting> waiting = {{scene_.mRootNode, -1, 1}};
  while (!waiting.empty()) {  // not recursive: a hostile depth must not exhaust the stack
    const Waiting next = waiting.back();
    waiting.pop_back();
    const std::string name = next.node->mName.C_Str();
    if (file_.nodes.size() >= kMaxNodes) Refuse(file_, "too many nodes", "at most " + std::to_string(kMaxNodes));
    if (next.depth > kMaxDepth)
      Refuse(file_, "nodes that are nested too deep", "at most " + std::to_string(kMaxDepth) + " levels");
    const size_t index = file_.nodes.size();
    CharacterNode node;
    node.name = name;
    node.parent = next.parent;
    node.local = Matrix(next.node->mTransformation, "the transform of '" + name + "'");
    node.helper =
        name.find("_$AssimpFbx$_") != std::string::npos || (file_.format == "BVH" && name.starts_with("EndSite"));
    rest_.push_back(next.parent < 0 ? node.local
                                    : Eigen::Matrix4d(rest_[static_cast<size_t>(next.parent)] * node.local));
    file_.nodes.push_back(std::move(node));
    index_.emplace(name, index);
    ++count_[name];
    for (unsigned i = 0; i < next.node->mNumMeshes; ++i) {
      if (next.node->mMeshes[i] < scene_.mNumMeshes) mesh_node_.emplace(scene_.mMeshes[next.node->mMeshes[i]], index);
    }
    for (unsigned i = next.node->mNumChildren; i-- > 0;) {
      if (next.node->mChildren[i] != nullptr) {
        waiting.push_back({next.node->mChildren[i], static_cast<int32_t>(index), next.depth + 1});
      }
    }
  }
}

// FBX says its axes and its unit; BVH says nothing.
void AssimpReader::ReadSpace() {
  if (file_.format != "FBX" || scene_.mMetaData == nullptr) return;
  double unit = 0;
  float unit_f32 = 0;
  if (!scene_.mMetaData->Get("UnitScaleFactor", unit) && scene_.mMetaData->Get("UnitScaleFactor", unit_f32)) {
    unit = static_cast<double>(unit_f32);
  }
  if (unit != 0) {
    if (!(unit > 1e-6 && unit < 1e6))
      Refuse(file_, "UnitScaleFactor " + std::to_string(unit), "the number of centimetres in a unit");
    file_.metres_per_unit = unit / 100;
  }
  const char* const axes[3] = {"CoordAxis", "UpAxis", "FrontAxis"};
  Eigen::Matrix3d upright = Eigen::Matrix3d::Zero();
  for (int row = 0; row < 3; ++row) {
    int32_t axis = -1, sign = 1;
    if (!scene_.mMetaData->Get(axes[row], axis)) return;
    scene_.mMetaData->Get(std::string(axes[row]) + "Sign", sign);
    if (axis < 0 || axis > 2 || (sign != 1 && sign != -1)) {
      Refuse(file_, std::string(axes[row]) + " " + std::to_string(axis) + ", sign " + std::to_string(sign),
             "an axis of 0, 1 or 2 and a sign of 1 or -1");
    }
    upright(row, axis) = sign;
  }
  if (std::abs(upright.determinant() - 1) > 1e-9) Refuse(file_, "axes that mirror or coincide", "right-handed axes");
  file_.upright = upright;
}

NodeChannel AssimpReader::ReadChannel(const aiNodeAnim& channel, double ticks_per_second,
                                      const std::string& clip) const {
  const std::string where = "clip '" + clip + "', channel of '" + channel.mNodeName.C_Str() + "'";
  NodeChannel out;
  out.node = NodeOf(channel.mNodeName, "clip '" + clip + "' has a channel");
  if (std::max({channel.mNumPositionKeys, channel.mNumRotationKeys, channel.mNumScalingKeys}) > kMaxKeys) {
    Refuse(file_, "too many keys in " + where, "at most " + std::to_string(kMaxKeys));
  }
  double last = -kMaxSeconds;
  const auto seconds = [&](double ticks) {
    const double at = ticks / ticks_per_second;
    if (!(at >= last && at <= kMaxSeconds)) {
      Refuse(file_, "a key at " + std::to_string(at) + " s in " + where, "increasing times within a day");
    }
    return last = at;
  };
  const auto vectors = [&](const aiVectorKey* keys, unsigned count, Curve<Eigen::Vector3d>* to) {
    last = -kMaxSeconds;
    for (unsigned i = 0; i < count; ++i) {
      const aiVector3D& v = keys[i].mValue;
      to->keys.emplace_back(seconds(keys[i].mTime), Eigen::Vector3d(v.x, v.y, v.z));
      for (int a = 0; a < 3; ++a) CheckNumber(file_, to->keys.back().second[a], where);
    }
  };
  vectors(channel.mPositionKeys, channel.mNumPositionKeys, &out.positions);
  vectors(channel.mScalingKeys, channel.mNumScalingKeys, &out.scales);
  last = -kMaxSeconds;
  for (unsigned i = 0; i < channel.mNumRotationKeys; ++i) {
    const aiQuaternion& q = channel.mRotationKeys[i].mValue;
    Eigen::Quaterniond value(q.w, q.x, q.y, q.z);
    const double length = value.norm();
    if (!std::isfinite(length) || length < 1e-3 || length > 1e3)
      Refuse(file_, "a rotation without a direction in " + where, "unit quaternions");
    value.coeffs() /= length;
    out.rotations.keys.emplace_back(seconds(channel.mRotationKeys[i].mTime), value);
  }
  return out;
}

CharacterClip AssimpReader::ReadClip(const aiAnimation& animation, size_t index) const {
  CharacterClip clip;
  clip.name = animation.mName.length != 0 ? animation.mName.C_Str() : "clip " + std::to_string(index);
  double rate = animation.mTicksPerSecond;
  // BVH has a frame time of six decimals: 0.033333 s means 30 Hz.
  if (file_.format == "BVH" && std::abs(rate - std::round(rate)) < 1e-4 * rate) rate = std::round(rate);
  if (!(rate > 0 && rate <= 1e12))
    Refuse(file_, "clip '" + clip.name + "' at " + std::to_string(rate) + " ticks a second", "a positive rate");
  std::vector<bool> seen(file_.nodes.size());
  for (unsigned i = 0; i < animation.mNumChannels; ++i) {
    NodeChannel channel = ReadChannel(*animation.mChannels[i], rate, clip.name);
    if (seen[channel.node])
      Refuse(file_, "two channels of '" + file_.nodes[channel.node].name + "' in clip '" + clip.name + "'",
             "one channel for each node");
    seen[channel.node] = true;
    clip.channels.push_back(std::move(channel));
  }
  SetSpan(&clip);
  return clip;
}

CharacterFile AssimpReader::Read(bool meshes) {
  ReadNodes();
  ReadSpace();
  if (scene_.mNumAnimations > kMaxClips)
    Refuse(file_, std::to_string(scene_.mNumAnimations) + " clips", "at most 4096");
  for (unsigned i = 0; i < scene_.mNumAnimations; ++i) file_.clips.push_back(ReadClip(*scene_.mAnimations[i], i));
  if (meshes) ReadMaterials();
  std::vector<BoundMesh> skinned;
  for (unsigned i = 0; i < scene_.mNumMeshes; ++i) {
    if (scene_.mMeshes[i]->mNumBones != 0)
      skinned.push_back(ReadMesh(*scene_.mMeshes[i], meshes));
    else
      ++file_.loose_meshes;
  }
  AddSkins(skinned, meshes, &file_);
  return std::move(file_);
}

CharacterFile ReadByAssimp(const std::filesystem::path& path, const std::string& format, bool meshes) {
  MemoryLimit limit;
  Folder folder(path.parent_path(), &limit);
  Assimp::Importer importer;
  auto* const files = new AssimpFiles(&folder);
  importer.SetIOHandler(files);  // which the importer owns now
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_TEXTURES, meshes);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_CAMERAS, false);
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_READ_LIGHTS, false);
  // BVH: no made-up mesh that shows the bones.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_NO_SKELETON_MESHES, true);
  // Pivots are multiplied into the keys: kept apart, nodes without curves of their own lose pre-rotation and place.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_PRESERVE_PIVOTS, false);
  // Animation curves that never change still place their joint.
  importer.SetPropertyBool(AI_CONFIG_IMPORT_FBX_OPTIMIZE_EMPTY_ANIMATION_CURVES, false);
  const aiScene* const scene = importer.ReadFile(path.string(), meshes ? unsigned{aiProcess_Triangulate} : 0);
  limit.Lift();
  if (scene == nullptr) {
    const std::string reason = importer.GetErrorString();
    const bool memory = reason.find("bad_alloc") != std::string::npos;
    throw converter::Error({.path = path,
                            .tensor = {},
                            .found = memory ? "a file that assimp needs more memory for than " +
                                                  std::to_string(limit.allowance() >> 20) + " MiB"
                                            : "a file that assimp cannot read: " + reason,
                            .expected = "a sound " + format + " file",
                            .mend = "export it again"});
  }
  return AssimpReader(*scene, *files, format, path).Read(meshes);
}

}  // namespace dcloth::tools
