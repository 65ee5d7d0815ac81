// The skin: which pose it was bound in, its vertices, weights and pictures.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <span>
#include <string_view>
#include <system_error>

#include "converter/file.h"
#include "tools/character/assimp_reader.h"

namespace dcloth::tools {
namespace {

constexpr double kSamePose = 1e-4;  // metres, and of a matrix's own size
constexpr size_t kMostPictureBytes = size_t{24} << 20;
constexpr double kSameBind = 1e-3;  // of a bind pose that two meshes give one bone

bool IsSameBind(const Eigen::Matrix4d& a, const Eigen::Matrix4d& b) {
  return (a - b).cwiseAbs().maxCoeff() <= kSameBind * std::max(1.0, b.cwiseAbs().maxCoeff());
}

}  // namespace

// From a mesh's own space, in the pose it was bound in, to world. FBX applies the transform of the mesh's node. glTF
// ignores it: there a bone's rest times its bind matrix is that map, the same for every bone where the nodes stand in
// the bind pose (files whose root turns Z up or scales centimetres); where they stand in another pose the mesh is taken
// as it is.
Eigen::Matrix4d AssimpReader::OwnToWorld(const aiMesh& mesh) const {
  if (file_.format != "glTF") {
    const auto node = mesh_node_.find(&mesh);
    return node == mesh_node_.end() ? Eigen::Matrix4d::Identity() : rest_[node->second];
  }
  Eigen::Matrix4d first = Eigen::Matrix4d::Identity();
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const size_t node = NodeOf(mesh.mBones[b]->mName, "a bone");
    const Eigen::Matrix4d map = rest_[node] * Matrix(mesh.mBones[b]->mOffsetMatrix, "a bind matrix");
    if (b == 0) first = map;
    const Eigen::Vector3d apart = (map - first).topRightCorner<3, 1>();
    const double size = first.topLeftCorner<3, 3>().cwiseAbs().maxCoeff();
    const bool turned = ((map - first).topLeftCorner<3, 3>().cwiseAbs().maxCoeff() > kSamePose * size);
    if (turned || apart.norm() > kSamePose) return Eigen::Matrix4d::Identity();
  }
  return first.isIdentity(kSamePose) ? Eigen::Matrix4d::Identity() : first;
}

// A mesh may lie in a space of its own, as an eye in its head's: then the same map takes its bones to the bind pose
// that other meshes gave them.
Eigen::Matrix4d AssimpReader::MeshToWorld(const aiMesh& mesh) const {
  Eigen::Matrix4d own = OwnToWorld(mesh);
  std::optional<Eigen::Matrix4d> told;
  bool fits = true;
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const Eigen::Matrix4d offset = Matrix(mesh.mBones[b]->mOffsetMatrix, "a bind matrix");
    const std::optional<Eigen::Matrix4d>& known = file_.nodes[NodeOf(mesh.mBones[b]->mName, "a bone")].bind;
    if (!known) continue;
    if (!told) told = *known * offset;
    if (!IsSameBind(*told * offset.inverse(), *known)) return own;
    fits = fits && IsSameBind(own * offset.inverse(), *known);
  }
  return told && !fits ? *told : own;
}

void AssimpReader::ReadBind(const aiMesh& mesh) {
  const Eigen::Matrix4d to_world = MeshToWorld(mesh);
  const std::string name = mesh.mName.C_Str();
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const aiBone& bone = *mesh.mBones[b];
    const size_t node = NodeOf(bone.mName, "a bone of mesh '" + name + "'");
    const Eigen::Matrix4d offset = Matrix(bone.mOffsetMatrix, "the bind matrix of '" + file_.nodes[node].name + "'");
    if (std::abs(offset.topLeftCorner<3, 3>().determinant()) < 1e-12) {
      Refuse("a bind matrix that has no inverse for bone '" + file_.nodes[node].name + "'", "an invertible matrix");
    }
    const Eigen::Matrix4d bind = to_world * offset.inverse();
    std::optional<Eigen::Matrix4d>& known = file_.nodes[node].bind;
    // Meshes of one skeleton agree, or no pose fits the file.
    if (known && !IsSameBind(*known, bind)) {
      Refuse("a second bind pose of bone '" + file_.nodes[node].name + "' in mesh '" + name + "'", "one bind pose",
             "bind all meshes in the same pose, or export only the body");
    }
    if (!known) known = bind;
  }
}

// What a browser can show: assimp hands on the bytes of an embedded file.
bool IsPicture(std::span<const std::byte> bytes) {
  const auto begins = [&](std::string_view with, size_t at) {
    return bytes.size() >= at + with.size() && std::memcmp(bytes.data() + at, with.data(), with.size()) == 0;
  };
  return begins("\x89PNG", 0) || begins("\xFF\xD8\xFF", 0) || (begins("RIFF", 0) && begins("WEBP", 8));
}

// The picture of a surface's colour, embedded or a file in the character's folder; -1 for none that can be shown.
int32_t AssimpReader::ReadPicture(const aiMaterial& material) {
  aiString name;
  if (material.GetTexture(aiTextureType_BASE_COLOR, 0, &name) != aiReturn_SUCCESS &&
      material.GetTexture(aiTextureType_DIFFUSE, 0, &name) != aiReturn_SUCCESS)
    return -1;
  if (const auto known = pictures_.find(name.C_Str()); known != pictures_.end()) return known->second;
  int32_t& index = pictures_[name.C_Str()] = -1;
  size_t held = 0;
  for (const auto& picture : file_.pictures) held += picture.size();
  const auto keep = [&](std::span<const std::byte> bytes) {
    if (!IsPicture(bytes) || bytes.size() > kMostPictureBytes - held) return;
    index = static_cast<int32_t>(file_.pictures.size());
    file_.pictures.emplace_back(bytes.begin(), bytes.end());
  };
  if (const aiTexture* const embedded = scene_.GetEmbeddedTexture(name.C_Str())) {
    if (embedded->mHeight == 0 && embedded->pcData != nullptr)
      keep(std::as_bytes(std::span(reinterpret_cast<const char*>(embedded->pcData), embedded->mWidth)));
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
      keep(converter::ReadFile(file, kMostPictureBytes));
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
    aiString alpha;
    material.cut_out =
        from.Get("$mat.gltf.alphaMode", 0, 0, alpha) == aiReturn_SUCCESS && std::string_view(alpha.C_Str()) != "OPAQUE";
    file_.materials.push_back(material);
  }
}

void AssimpReader::ReadMesh(const aiMesh& mesh) {
  SkinnedMesh out;
  out.name = mesh.mName.C_Str();
  if (mesh.mMaterialIndex < file_.materials.size()) out.material = mesh.mMaterialIndex;
  const aiVector3D* const coordinates = mesh.mTextureCoords[0];
  // By definition linear and times the material's in glTF; what other formats keep there is often no colour.
  const aiColor4D* const colours = file_.format == "glTF" ? mesh.mColors[0] : nullptr;
  if (mesh.mNumVertices > (1u << 24) || mesh.mNumFaces > (1u << 25))
    Refuse("a mesh '" + out.name + "' of more than 2^24 vertices", "at most 2^24");
  const Eigen::Matrix4d to_world = MeshToWorld(mesh);
  // Readers cut a mesh at every face; vertices on the same place are one again.
  std::map<std::array<ai_real, 3>, uint32_t> place;
  std::vector<uint32_t> vertex_of(mesh.mNumVertices);
  for (unsigned i = 0; i < mesh.mNumVertices; ++i) {
    const aiVector3D& v = mesh.mVertices[i];
    for (const ai_real x : {v.x, v.y, v.z}) Number(static_cast<double>(x), "vertices of mesh '" + out.name + "'");
    const auto [at, fresh] = place.try_emplace({v.x, v.y, v.z}, static_cast<uint32_t>(out.positions.size()));
    if (fresh) out.positions.emplace_back((to_world * Eigen::Vector4d(v.x, v.y, v.z, 1)).head<3>());
    vertex_of[i] = at->second;
  }
  for (unsigned f = 0; f < mesh.mNumFaces; ++f) {
    const aiFace& face = mesh.mFaces[f];
    if (face.mNumIndices != 3) continue;  // points and lines have no surface
    std::array<uint32_t, 3> corner;
    for (unsigned k = 0; k < 3; ++k) {
      if (face.mIndices[k] >= mesh.mNumVertices)
        Refuse("a face of mesh '" + out.name + "' with a vertex that does not exist", "indices below the vertex count");
      corner[k] = vertex_of[face.mIndices[k]];
    }
    if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) continue;
    out.triangles.insert(out.triangles.end(), corner.begin(), corner.end());
    for (unsigned k = 0; coordinates != nullptr && k < 3; ++k) {
      const aiVector3D& at = coordinates[face.mIndices[k]];
      const bool sound = std::isfinite(at.x) && std::isfinite(at.y);
      // assimp counts from the lower left.
      out.texture_coordinates.push_back(sound ? static_cast<float>(at.x) : 0);
      out.texture_coordinates.push_back(sound ? static_cast<float>(1 - at.y) : 0);
    }
    for (unsigned k = 0; colours != nullptr && k < 3; ++k) {
      const aiColor4D& at = colours[face.mIndices[k]];
      for (const ai_real part : {at.r, at.g, at.b}) {
        const float sound = std::isfinite(part) ? std::clamp(static_cast<float>(part), 0.0f, 1.0f) : 1.0f;
        out.colours.push_back(static_cast<uint8_t>(std::lround(255 * std::pow(sound, 1 / 2.2f))));
      }
    }
  }
  std::map<std::pair<uint32_t, uint32_t>, float> weights;  // (vertex, node): copies of a vertex agree
  for (unsigned b = 0; b < mesh.mNumBones; ++b) {
    const aiBone& bone = *mesh.mBones[b];
    const auto node = static_cast<uint32_t>(NodeOf(bone.mName, "a bone of mesh '" + out.name + "'"));
    for (unsigned w = 0; w < bone.mNumWeights; ++w) {
      const aiVertexWeight& weight = bone.mWeights[w];
      if (weight.mVertexId >= mesh.mNumVertices || !std::isfinite(weight.mWeight) || weight.mWeight < 0) {
        Refuse("a weight of bone '" + file_.nodes[node].name + "' that is negative or not finite, or has no vertex",
               "finite weights of 0 or more for vertices of the mesh");
      }
      if (weight.mWeight > 0) weights[{vertex_of[weight.mVertexId], node}] = static_cast<float>(weight.mWeight);
    }
  }
  for (const auto& [key, weight] : weights) out.influences.push_back({key.first, key.second, weight});
  file_.meshes.push_back(std::move(out));
}

}  // namespace dcloth::tools
