// The skin: its bones, vertices, weights and pictures.
#include <algorithm>
#include <cmath>
#include <span>
#include <system_error>

#include "converter/file.h"
#include "tools/character/assimp_reader.h"
#include "tools/character/matrix_values.h"

namespace dcloth::tools {

// The picture of a surface's colour, embedded or a file in the character's folder; -1 for none that can be shown.
int32_t AssimpReader::ReadPicture(const aiMaterial& material) {
  aiString name;
  if (material.GetTexture(aiTextureType_BASE_COLOR, 0, &name) != aiReturn_SUCCESS &&
      material.GetTexture(aiTextureType_DIFFUSE, 0, &name) != aiReturn_SUCCESS)
    return -1;
  if (const auto known = pictures_.find(name.C_Str()); known != pictures_.end()) return known->second;
  int32_t& index = pictures_[name.C_Str()] = -1;
  if (const aiTexture* const embedded = scene_.GetEmbeddedTexture(name.C_Str())) {
    if (embedded->mHeight == 0 && embedded->pcData != nullptr)
      index = KeepPicture(std::as_bytes(std::span(reinterpret_cast<const char*>(embedded->pcData), embedded->mWidth)),
                          &file_);
    return index;
  }
  std::string written = name.C_Str();
  std::ranges::replace(written, '\\', '/');
  for (const std::filesystem::path& tried :
       {std::filesystem::path(written), std::filesystem::path(written).filename()}) {
    const std::filesystem::path file = file_.path.parent_path() / tried;
    if (!files_.Exists(file.string().c_str())) continue;
    std::error_code failed;
    if (std::filesystem::file_size(file, failed) <= kMostPictureBytes && !failed)
      index = KeepPicture(converter::ReadFile(file, kMostPictureBytes), &file_);
    break;
  }
  return index;
}

void AssimpReader::ReadMaterials() {
  for (unsigned i = 0; i < scene_.mNumMaterials; ++i) {
    const aiMaterial& from = *scene_.mMaterials[i];
    Material material;
    aiColor4D colour(1, 1, 1, 1);
    const bool linear = from.Get(AI_MATKEY_BASE_COLOR, colour) == aiReturn_SUCCESS;
    material.picture = ReadPicture(from);
    // A diffuse colour beside a picture is a viewer's default more often than a tint.
    if (!linear && material.picture < 0) from.Get(AI_MATKEY_COLOR_DIFFUSE, colour);
    const ai_real parts[3] = {colour.r, colour.g, colour.b};
    for (size_t c = 0; c < 3; ++c) {
      const float part = std::isfinite(parts[c]) ? std::clamp(static_cast<float>(parts[c]), 0.0f, 1.0f) : 1.0f;
      material.colour[c] = linear ? part : std::pow(part, 2.2f);
    }
    file_.materials.push_back(material);
  }
}

// FBX applies the transform of the mesh's node.
BoundMesh AssimpReader::ReadMesh(const aiMesh& mesh, bool surface) const {
  BoundMesh out;
  out.name = mesh.mName.C_Str();
  const std::string where = "mesh '" + out.name + "'";
  if (const auto node = mesh_node_.find(&mesh); node != mesh_node_.end()) out.own_to_world = rest_[node->second];
  if (mesh.mMaterialIndex < file_.materials.size()) out.material = mesh.mMaterialIndex;
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const aiBone& bone = *mesh.mBones[b];
    const size_t node = NodeOf(bone.mName, "a bone of " + where);
    out.bones.push_back({node, Matrix(bone.mOffsetMatrix, "the bind matrix of '" + file_.nodes[node].name + "'")});
    for (unsigned w = 0; surface && w < bone.mNumWeights; ++w) {
      out.influences.push_back(
          {bone.mWeights[w].mVertexId, static_cast<uint32_t>(node), static_cast<float>(bone.mWeights[w].mWeight)});
    }
  }
  if (!surface) return out;
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const aiVector3D& v = mesh.mVertices[i];
    out.positions.push_back({static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)});
    if (mesh.mTextureCoords[0] == nullptr) continue;
    const aiVector3D& at = mesh.mTextureCoords[0][i];
    out.texture_coordinates.push_back({static_cast<float>(at.x), static_cast<float>(1 - at.y)});  // from the lower left
  }
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    if (face.mNumIndices != 3) continue;  // points and lines have no surface
    out.triangles.push_back({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
  }
  return out;
}

}  // namespace dcloth::tools
