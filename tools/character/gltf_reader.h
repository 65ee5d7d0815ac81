// glTF 2.0 (also VRM and VRMA) as a character: nodes by index, animations by appendix C, skins as they are defined.
#ifndef DCLOTH_TOOLS_CHARACTER_GLTF_READER_H_
#define DCLOTH_TOOLS_CHARACTER_GLTF_READER_H_

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tools/character/bound_mesh.h"
#include "tools/character/folder.h"
#include "tools/character/gltf_accessor.h"

namespace dcloth::tools {

class GltfReader {
 public:
  // `folder` holds the pictures beside the file. All outlive it.
  GltfReader(const std::filesystem::path& path, const tinygltf::Model& model, Folder* folder);

  // Throws converter::Error.
  CharacterFile Read(bool meshes);

 private:
  std::vector<int> Roots() const;
  void ReadNodes();
  Eigen::Matrix4d Local(const tinygltf::Node& node, const std::string& name) const;
  void NameNodes();
  void ReadRoles();
  std::optional<size_t> NodeOf(int node) const;  // of the file; nothing where the scene does not have it

  void ReadClip(const tinygltf::Animation& animation, size_t index);
  template <typename Value, typename Make>
  void ReadCurve(const tinygltf::AnimationSampler& sampler, const std::string& where, const Make& make,
                 Curve<Value>* to) const;

  std::vector<SkinBone> BonesOf(const tinygltf::Skin& skin, const std::string& where) const;
  Eigen::Matrix4d OwnToWorld(std::span<const SkinBone> bones) const;
  void AddMesh(const tinygltf::Node& node, bool meshes, std::vector<BoundMesh>* to);
  BoundMesh ReadPrimitive(const tinygltf::Primitive& primitive, std::span<const double> weights,
                          const BoundMesh& empty) const;
  void ReadPositions(const tinygltf::Primitive& primitive, std::span<const double> weights, BoundMesh* mesh) const;
  void ReadInfluences(const tinygltf::Primitive& primitive, BoundMesh* mesh) const;
  void ReadLooks(const tinygltf::Primitive& primitive, BoundMesh* mesh) const;
  void PlaceByRest(BoundMesh* mesh) const;

  void ReadMaterials();
  int32_t ReadPicture(int texture);

  const tinygltf::Model& model_;
  Folder* folder_;
  CharacterFile file_;
  GltfAccessors values_;
  std::vector<int> from_;                       // the glTF node of each of the file's
  std::vector<std::optional<size_t>> node_of_;  // the file's node of each of glTF's
  std::vector<Eigen::Matrix4d> rest_;           // the file's nodes to world, without animation
  std::map<int, int32_t> pictures_;             // by glTF's image
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_GLTF_READER_H_
