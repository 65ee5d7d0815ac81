// Bytes as a scene that a reader of artists' files could hand over, and what a user asks of it.
#include <assimp/scene.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <string>

#include "tests/fuzz/character_use.h"
#include "tools/character/assimp_reader.h"

namespace dcloth::testing {
namespace {

struct SceneRequest {
  std::string format;  // "FBX" or "BVH"
  std::unique_ptr<aiScene> scene;
  CharacterRequest user;
};

class ByteStream {
 public:
  ByteStream(const uint8_t* bytes, size_t size) : next_(bytes), end_(bytes + size) {}

  uint8_t Byte() { return next_ == end_ ? uint8_t{0} : *next_++; }
  unsigned Below(unsigned limit) { return limit == 0 ? 0 : Byte() % limit; }

  // Mostly small sixteenths, then what lies at an edge, then any bits.
  float Number() {
    constexpr float kInfinity = std::numeric_limits<float>::infinity();
    constexpr float kEdges[] = {1e9f,   -1e9f, 1e30f,   3e38f,     1e-30f,
                                1e-42f, 100.f, 86400.f, kInfinity, std::numeric_limits<float>::quiet_NaN()};
    const uint8_t tag = Byte();
    if (tag < 240) return static_cast<float>(tag < 120 ? tag : 119 - tag) / 16;
    if (tag < 250) return kEdges[tag - 240];
    uint8_t raw[4];
    for (uint8_t& byte : raw) byte = Byte();
    float value;
    std::memcpy(&value, raw, 4);
    return value;
  }

  // Few names, so that references find what they mean; the last ones are like those that readers make up.
  std::string Name() {
    const unsigned tag = Below(32);
    switch (tag) {
      case 31:
        return "";
      case 30:
        return std::string(1000, 'x');
      case 29:
        return "\xff\xfe";
      case 28:
        return "EndSite_n0";
      case 27:
        return "n0_$AssimpFbx$_Rotation";
      default:
        return "n" + std::to_string(tag);
    }
  }

  aiMatrix4x4 Matrix() {
    aiMatrix4x4 matrix;
    switch (Below(4)) {
      case 0:
        break;
      case 1:
        matrix.a4 = Number(), matrix.b4 = Number(), matrix.c4 = Number();
        break;
      case 2:
        matrix.a1 = Number(), matrix.b2 = Number(), matrix.c3 = Number();
        break;
      default:
        for (unsigned i = 0; i < 16; ++i) matrix[i / 4][i % 4] = Number();
    }
    return matrix;
  }

  // What a file says: mostly one of `count`.
  unsigned Index(unsigned count) {
    const unsigned tag = Byte();
    return tag >= 248 ? tag * 0x01010101u : count == 0 ? tag : tag % count;
  }

 private:
  const uint8_t *next_, *end_;
};

// As many as `count` says, and the same for the scene, which owns them.
template <typename Element>
Element* Array(unsigned count, unsigned* counted) {
  *counted = count;
  return count == 0 ? nullptr : new Element[count]();
}

void DecodeNodes(ByteStream* bytes, aiScene* scene) {
  std::vector<aiNode*> nodes(bytes->Byte());
  std::vector<std::vector<aiNode*>> children(nodes.size());
  for (size_t i = 0; i < nodes.size(); ++i) {
    nodes[i] = new aiNode(bytes->Name());
    if (i > 0) {
      const unsigned parent = bytes->Byte();
      children[parent >= 128 ? i - 1 : parent % i].push_back(nodes[i]);
    }
    nodes[i]->mTransformation = bytes->Matrix();
    nodes[i]->mMeshes = Array<unsigned>(bytes->Below(3), &nodes[i]->mNumMeshes);
    for (unsigned m = 0; m < nodes[i]->mNumMeshes; ++m) nodes[i]->mMeshes[m] = bytes->Index(4);
  }
  for (size_t i = 0; i < nodes.size(); ++i) {
    if (!children[i].empty()) nodes[i]->addChildren(static_cast<unsigned>(children[i].size()), children[i].data());
  }
  scene->mRootNode = nodes.empty() ? nullptr : nodes.front();
}

void DecodeMetadata(ByteStream* bytes, aiScene* scene) {
  const unsigned present = bytes->Byte();
  if (present == 0) return;
  scene->mMetaData = new aiMetadata();
  if (present & 1) scene->mMetaData->Add("UnitScaleFactor", bytes->Number());
  if (present & 2) scene->mMetaData->Add("UnitScaleFactor", static_cast<double>(bytes->Number()));
  const char* const axes[] = {"CoordAxis", "UpAxis", "FrontAxis"};
  for (unsigned a = 0; a < 3; ++a) {
    if (present & (4u << a)) scene->mMetaData->Add(axes[a], static_cast<int32_t>(bytes->Index(3)));
    if (present & 32) scene->mMetaData->Add(std::string(axes[a]) + "Sign", bytes->Byte() & 1 ? -1 : 1);
  }
}

aiBone* DecodeBone(ByteStream* bytes, unsigned vertex_count) {
  auto* bone = new aiBone();
  bone->mName = bytes->Name();
  bone->mOffsetMatrix = bytes->Matrix();
  bone->mWeights = Array<aiVertexWeight>(bytes->Below(16), &bone->mNumWeights);
  for (unsigned w = 0; w < bone->mNumWeights; ++w) {
    bone->mWeights[w].mVertexId = bytes->Index(vertex_count);
    bone->mWeights[w].mWeight = bytes->Number();
  }
  return bone;
}

aiMesh* DecodeMesh(ByteStream* bytes) {
  auto* mesh = new aiMesh();
  mesh->mName = bytes->Name();
  mesh->mVertices = Array<aiVector3D>(bytes->Below(32), &mesh->mNumVertices);
  for (unsigned v = 0; v < mesh->mNumVertices; ++v) {
    for (unsigned a = 0; a < 3; ++a) mesh->mVertices[v][a] = bytes->Number();
  }
  mesh->mFaces = Array<aiFace>(bytes->Below(32), &mesh->mNumFaces);
  for (unsigned f = 0; f < mesh->mNumFaces; ++f) {
    const unsigned shape = bytes->Byte();  // mostly triangles
    mesh->mFaces[f].mIndices = Array<unsigned>(shape < 224 ? 3 : shape % 5, &mesh->mFaces[f].mNumIndices);
    for (unsigned k = 0; k < mesh->mFaces[f].mNumIndices; ++k) {
      mesh->mFaces[f].mIndices[k] = bytes->Index(mesh->mNumVertices);
    }
  }
  mesh->mBones = Array<aiBone*>(bytes->Below(6), &mesh->mNumBones);
  for (unsigned b = 0; b < mesh->mNumBones; ++b) mesh->mBones[b] = DecodeBone(bytes, mesh->mNumVertices);
  return mesh;
}

void DecodeKeys(ByteStream* bytes, unsigned count, aiVectorKey* keys) {
  for (unsigned i = 0; i < count; ++i) {
    keys[i].mTime = static_cast<double>(bytes->Number());
    for (unsigned a = 0; a < 3; ++a) keys[i].mValue[a] = bytes->Number();
  }
}

aiNodeAnim* DecodeChannel(ByteStream* bytes) {
  auto* channel = new aiNodeAnim();
  channel->mNodeName = bytes->Name();
  channel->mPositionKeys = Array<aiVectorKey>(bytes->Below(4), &channel->mNumPositionKeys);
  DecodeKeys(bytes, channel->mNumPositionKeys, channel->mPositionKeys);
  channel->mScalingKeys = Array<aiVectorKey>(bytes->Below(4), &channel->mNumScalingKeys);
  DecodeKeys(bytes, channel->mNumScalingKeys, channel->mScalingKeys);
  channel->mRotationKeys = Array<aiQuatKey>(bytes->Below(4), &channel->mNumRotationKeys);
  for (unsigned i = 0; i < channel->mNumRotationKeys; ++i) {
    aiQuatKey& key = channel->mRotationKeys[i];
    key.mTime = static_cast<double>(bytes->Number());
    key.mValue.w = bytes->Number(), key.mValue.x = bytes->Number();
    key.mValue.y = bytes->Number(), key.mValue.z = bytes->Number();
  }
  return channel;
}

aiAnimation* DecodeAnimation(ByteStream* bytes) {
  auto* animation = new aiAnimation();
  animation->mName = bytes->Name();
  animation->mTicksPerSecond = static_cast<double>(bytes->Number());
  animation->mChannels = Array<aiNodeAnim*>(bytes->Below(6), &animation->mNumChannels);
  for (unsigned c = 0; c < animation->mNumChannels; ++c) animation->mChannels[c] = DecodeChannel(bytes);
  return animation;
}

Eigen::Matrix4d ToEigen(const aiMatrix4x4& matrix) {
  Eigen::Matrix4d out;
  for (unsigned i = 0; i < 16; ++i) out(i / 4, i % 4) = static_cast<double>(matrix[i / 4][i % 4]);
  return out;
}

void DecodeWishes(ByteStream* bytes, CharacterRequest* request) {
  const char* const units[] = {"", "", "cm", "m"};
  const char* const ups[] = {"", "", "y", "z"};
  request->space = {units[bytes->Below(4)], ups[bytes->Below(4)]};
  for (unsigned left = bytes->Below(4); left > 0; --left) {
    const std::string joint = bytes->Name();
    request->map.emplace(joint, bytes->Name());
  }
  for (unsigned left = bytes->Below(8); left > 0; --left) {
    const std::string joint = bytes->Name();
    if (std::ranges::find(request->wanted, joint) == request->wanted.end()) request->wanted.push_back(joint);
  }
  if (bytes->Below(2) == 0) return;
  for (size_t j = 0; j < request->wanted.size(); ++j) {
    const Eigen::Matrix4d bind = ToEigen(bytes->Matrix());
    const bool sound = bind.allFinite() && std::abs(bind.topLeftCorner<3, 3>().determinant()) >= 1e-9;
    request->bind.push_back(sound ? bind : Eigen::Matrix4d::Identity());
  }
}

// Every byte string is one; where it ends, zeros follow. Sizes, indices within arrays and pointers are sound, as a
// reader's are that did not crash; names, references by name, numbers and the indices that a file holds need not be.
SceneRequest DecodeScene(const uint8_t* bytes, size_t size) {
  ByteStream stream(bytes, size);
  const char* const formats[] = {"FBX", "FBX", "BVH"};  // the first was glTF, which assimp reads no more
  SceneRequest request;
  request.format = formats[stream.Below(3)];
  DecodeWishes(&stream, &request.user);
  request.scene = std::make_unique<aiScene>();
  aiScene* const scene = request.scene.get();
  DecodeNodes(&stream, scene);
  DecodeMetadata(&stream, scene);
  scene->mMeshes = Array<aiMesh*>(stream.Below(4), &scene->mNumMeshes);
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) scene->mMeshes[m] = DecodeMesh(&stream);
  scene->mAnimations = Array<aiAnimation*>(stream.Below(4), &scene->mNumAnimations);
  for (unsigned a = 0; a < scene->mNumAnimations; ++a) scene->mAnimations[a] = DecodeAnimation(&stream);
  return request;
}

// Pictures of a scene are its own or none.
class NoFiles : public Assimp::IOSystem {
 public:
  bool Exists(const char*) const override { return false; }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char*, const char*) override { return nullptr; }
  void Close(Assimp::IOStream*) override {}
};

}  // namespace

Verdict FuzzScene(const uint8_t* bytes, size_t size) {
  const SceneRequest asked = DecodeScene(bytes, size);
  return ReadAndUse([&] { return tools::AssimpReader(*asked.scene, NoFiles(), asked.format, "scene").Read(true); },
                    asked.user);
}

}  // namespace dcloth::testing
