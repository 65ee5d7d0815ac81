// FBX and BVH as assimp hands them over: nodes by name.
#ifndef DCLOTH_TOOLS_CHARACTER_ASSIMP_READER_H_
#define DCLOTH_TOOLS_CHARACTER_ASSIMP_READER_H_

#include <assimp/scene.h>

#include <assimp/IOSystem.hpp>
#include <cstdint>
#include <map>
#include <string>
#include <unordered_map>

#include "tools/character/bound_mesh.h"

namespace dcloth::tools {

class AssimpReader {
 public:
  // `format`: "FBX" or "BVH". `files` says which of the files beside the first one may be read.
  AssimpReader(const aiScene& scene, const Assimp::IOSystem& files, std::string format,
               const std::filesystem::path& path);

  CharacterFile Read(bool meshes);

 private:
  Eigen::Matrix4d Matrix(const aiMatrix4x4& matrix, const std::string& where) const;
  size_t NodeOf(const aiString& name, const std::string& where) const;

  void ReadNodes();
  void ReadSpace();
  CharacterClip ReadClip(const aiAnimation& animation, size_t index) const;
  NodeChannel ReadChannel(const aiNodeAnim& channel, double ticks_per_second, const std::string& clip) const;
  BoundMesh ReadMesh(const aiMesh& mesh, bool surface) const;
  void ReadMaterials();
  int32_t ReadPicture(const aiMaterial& material);

  const aiScene& scene_;
  const Assimp::IOSystem& files_;
  CharacterFile file_;
  std::unordered_map<std::string, size_t> index_;  // the first node of a name
  std::unordered_map<std::string, size_t> count_;  // nodes of a name
  std::unordered_map<const aiMesh*, size_t> mesh_node_;
  std::map<std::string, int32_t> pictures_;  // by the name that materials give it
  std::vector<Eigen::Matrix4d> rest_;        // nodes to world, without animation
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_ASSIMP_READER_H_
