// glTF's skins and what they look like.
#include <algorithm>
#include <cmath>
#include <utility>

#include "tools/character/gltf_model.h"
#include "tools/character/gltf_reader.h"
#include "tools/character/matrix_values.h"

namespace dcloth::tools {
namespace {

constexpr double kSamePose = 1e-4;  // metres, and of a matrix's own size

const int* Attribute(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? nullptr : &found->second;
}

// KHR_texture_transform: how a texture's coordinates are turned, scaled and moved.
Eigen::Affine2d TextureTransform(const tinygltf::Material& material) {
  Eigen::Affine2d out = Eigen::Affine2d::Identity();
  const auto& extensions = material.pbrMetallicRoughness.baseColorTexture.extensions;
  const auto found = extensions.find("KHR_texture_transform");
  if (found == extensions.end() || !found->second.IsObject()) return out;
  const auto number = [&](const char* name, size_t index, double otherwise) {
    const tinygltf::Value& value = found->second.Get(name);
    const tinygltf::Value& part =
        value.IsArray() && index < value.ArrayLen() ? value.Get(static_cast<int>(index)) : value;
    return part.IsNumber() ? part.GetNumberAsDouble() : otherwise;
  };
  out.translate(Eigen::Vector2d(number("offset", 0, 0), number("offset", 1, 0)));
  out.rotate(-number("rotation", 0, 0));  // counted with v down
  out.scale(Eigen::Vector2d(number("scale", 0, 1), number("scale", 1, 1)));
  return out;
}

}  // namespace

// A skin without bind matrices has its vertices in its joints' own spaces.
std::vector<SkinBone> GltfReader::BonesOf(const tinygltf::Skin& skin, const std::string& where) const {
  std::vector<float> matrices;
  if (skin.inverseBindMatrices >= 0) matrices = values_.Floats(skin.inverseBindMatrices, 16, "the skin of " + where);
  if (!matrices.empty() && matrices.size() / 16 < skin.joints.size()) {
    Refuse(file_, std::to_string(matrices.size() / 16) + " bind matrices in the skin of " + where,
           "one for each of its " + std::to_string(skin.joints.size()) + " joints");
  }
  std::vector<SkinBone> bones;
  for (size_t j = 0; j < skin.joints.size(); ++j) {
    const std::optional<size_t> node = NodeOf(skin.joints[j]);
    if (!node) {
      Refuse(file_,
             "node " + std::to_string(skin.joints[j]) + " as a joint of " + where + ", which is not in its scene",
             "joints in the scene of their mesh", "export the character alone");
    }
    SkinBone bone{*node, Eigen::Matrix4d::Identity()};
    if (!matrices.empty()) {
      bone.inverse_bind = Eigen::Map<const Eigen::Matrix4f>(matrices.data() + 16 * j).cast<double>();
      bone.inverse_bind.row(3) << 0, 0, 0, 1;
      for (const double number : bone.inverse_bind.reshaped())
        CheckNumber(file_, number, "the bind matrix of '" + file_.nodes[*node].name + "'");
    }
    bones.push_back(bone);
  }
  return bones;
}

// From a mesh's own space, in the pose it was bound in, to world. The transform of the mesh's node is ignored: a bone's
// rest times its bind matrix is that map, the same for every bone where the nodes stand in the bind pose (files whose
// root turns Z up or scales centimetres, or whose bind matrices scale quantised places); where they stand in another
// pose the mesh is taken as it is.
Eigen::Matrix4d GltfReader::OwnToWorld(std::span<const SkinBone> bones) const {
  Eigen::Matrix4d first = Eigen::Matrix4d::Identity();
  for (size_t b = 0; b < bones.size(); ++b) {
    const Eigen::Matrix4d map = rest_[bones[b].node] * bones[b].inverse_bind;
    if (b == 0) first = map;
    const Eigen::Matrix4d apart = map - first;
    const double size = first.topLeftCorner<3, 3>().cwiseAbs().maxCoeff();
    const bool turned = apart.topLeftCorner<3, 3>().cwiseAbs().maxCoeff() > kSamePose * size;
    if (turned || apart.topRightCorner<3, 1>().norm() > kSamePose) return Eigen::Matrix4d::Identity();
  }
  return first.isIdentity(kSamePose) ? Eigen::Matrix4d::Identity() : first;
}

void GltfReader::AddMesh(const tinygltf::Node& node, bool meshes, std::vector<BoundMesh>* to) {
  if (node.mesh < 0) return;
  if (node.skin < 0) {
    ++file_.loose_meshes;
    return;
  }
  if (static_cast<size_t>(node.mesh) >= model_.meshes.size() || static_cast<size_t>(node.skin) >= model_.skins.size()) {
    Refuse(file_, "mesh " + std::to_string(node.mesh) + " with skin " + std::to_string(node.skin),
           "some of the file's " + std::to_string(model_.meshes.size()) + " meshes and " +
               std::to_string(model_.skins.size()) + " skins");
  }
  const tinygltf::Mesh& mesh = model_.meshes[static_cast<size_t>(node.mesh)];
  const tinygltf::Skin& skin = model_.skins[static_cast<size_t>(node.skin)];
  BoundMesh bound;
  bound.name = !mesh.name.empty() ? mesh.name : !node.name.empty() ? node.name : "mesh " + std::to_string(node.mesh);
  bound.bones = BonesOf(skin, "mesh '" + bound.name + "'");
  bound.own_to_world = OwnToWorld(bound.bones);
  const std::vector<double>& weights = node.weights.empty() ? mesh.weights : node.weights;
  for (const double weight : weights) CheckNumber(file_, weight, "morph weights of mesh '" + bound.name + "'");
  std::vector<BoundMesh> parts;
  for (const tinygltf::Primitive& primitive : mesh.primitives) {
    if (meshes) parts.push_back(ReadPrimitive(primitive, weights, bound));
  }
  if (!meshes) parts.push_back(bound);
  for (BoundMesh& part : parts) {
    if (skin.inverseBindMatrices < 0) PlaceByRest(&part);
    to->push_back(std::move(part));
  }
}

BoundMesh GltfReader::ReadPrimitive(const tinygltf::Primitive& primitive, std::span<const double> weights,
                                    const BoundMesh& empty) const {
  BoundMesh mesh = empty;
  if (primitive.material >= 0 && static_cast<size_t>(primitive.material) < file_.materials.size())
    mesh.material = static_cast<uint32_t>(primitive.material);
  ReadPositions(primitive, weights, &mesh);
  ReadInfluences(primitive, &mesh);
  ReadLooks(primitive, &mesh);
  const std::string where = "the triangles of mesh '" + mesh.name + "'";
  std::vector<uint32_t> corners;
  if (primitive.indices >= 0) corners = values_.Indices(primitive.indices, 1, where);
  for (uint32_t i = 0; primitive.indices < 0 && i < mesh.positions.size(); ++i) corners.push_back(i);
  const bool strip = primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP, fan = primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN;
  if (!strip && !fan && primitive.mode != TINYGLTF_MODE_TRIANGLES) return mesh;  // points and lines have no surface
  for (size_t i = 0; i + 2 < corners.size(); i += strip || fan ? 1 : 3) {
    const size_t odd = strip ? i % 2 : 0;
    mesh.triangles.push_back({corners[fan ? 0 : i], corners[i + 1 + odd], corners[i + 2 - odd]});
  }
  return mesh;
}

// Places, moved by the morph targets that are switched on from the start.
void GltfReader::ReadPositions(const tinygltf::Primitive& primitive, std::span<const double> weights,
                               BoundMesh* mesh) const {
  const std::string where = "the places of mesh '" + mesh->name + "'";
  const int* const position = Attribute(primitive.attributes, "POSITION");
  if (position == nullptr) Refuse(file_, "no POSITION for " + where, "places of vertices");
  std::vector<float> places = values_.Floats(*position, 3, where);
  for (size_t t = 0; t < std::min(weights.size(), primitive.targets.size()); ++t) {
    const int* const moved = Attribute(primitive.targets[t], "POSITION");
    if (moved == nullptr || weights[t] == 0) continue;
    const std::vector<float> moves = values_.Floats(*moved, 3, "a morph target of mesh '" + mesh->name + "'");
    if (moves.size() != places.size())
      Refuse(file_, "a morph target of other vertices in mesh '" + mesh->name + "'", "as many as the mesh has");
    for (size_t i = 0; i < places.size(); ++i) places[i] += static_cast<float>(weights[t]) * moves[i];
  }
  for (size_t i = 0; i + 2 < places.size(); i += 3)
    mesh->positions.push_back({places[i], places[i + 1], places[i + 2]});
}

void GltfReader::ReadInfluences(const tinygltf::Primitive& primitive, BoundMesh* mesh) const {
  const size_t count = mesh->positions.size();
  for (int set = 0;; ++set) {
    const int* const joint = Attribute(primitive.attributes, "JOINTS_" + std::to_string(set));
    const int* const weight = Attribute(primitive.attributes, "WEIGHTS_" + std::to_string(set));
    if (joint == nullptr || weight == nullptr) break;
    const std::string where = "mesh '" + mesh->name + "'";
    const std::vector<uint32_t> joints = values_.Indices(*joint, 4, "the joints of " + where);
    const std::vector<float> weights = values_.Floats(*weight, 4, "the weights of " + where);
    if (joints.size() != 4 * count || weights.size() != 4 * count) {
      Refuse(file_,
             std::to_string(joints.size() / 4) + " joints and " + std::to_string(weights.size() / 4) + " weights of " +
                 where,
             "one of each for its " + std::to_string(count) + " vertices");
    }
    for (size_t i = 0; i < weights.size(); ++i) {
      if (weights[i] == 0) continue;
      if (joints[i] >= mesh->bones.size()) {
        Refuse(file_, "joint " + std::to_string(joints[i]) + " of vertex " + std::to_string(i / 4) + " of " + where,
               "one of its skin's " + std::to_string(mesh->bones.size()));
      }
      mesh->influences.push_back(
          {static_cast<uint32_t>(i / 4), static_cast<uint32_t>(mesh->bones[joints[i]].node), weights[i]});
    }
  }
  // A joint may stand twice in a vertex' list.
  std::vector<SkinInfluence>& all = mesh->influences;
  std::ranges::stable_sort(all, {}, [](const SkinInfluence& i) { return std::pair(i.vertex, i.node); });
  size_t kept = 0;
  for (size_t i = 0; i < all.size(); ++i) {
    if (kept != 0 && all[kept - 1].vertex == all[i].vertex && all[kept - 1].node == all[i].node) {
      all[kept - 1].weight += all[i].weight;
    } else {
      all[kept++] = all[i];
    }
  }
  all.resize(kept);
}

void GltfReader::ReadLooks(const tinygltf::Primitive& primitive, BoundMesh* mesh) const {
  const std::string where = "mesh '" + mesh->name + "'";
  const size_t count = mesh->positions.size();
  if (const int* const coordinates = Attribute(primitive.attributes, "TEXCOORD_0")) {
    const std::vector<float> uv = values_.Floats(*coordinates, 2, "texture coordinates of " + where);
    const bool known = primitive.material >= 0 && static_cast<size_t>(primitive.material) < model_.materials.size();
    const Eigen::Affine2d transform =
        known ? TextureTransform(model_.materials[mesh->material]) : Eigen::Affine2d::Identity();
    for (size_t i = 0; i < count && 2 * i + 1 < uv.size(); ++i) {
      const Eigen::Vector2d at = transform * Eigen::Vector2d(double{uv[2 * i]}, double{uv[2 * i + 1]});
      mesh->texture_coordinates.push_back({static_cast<float>(at.x()), static_cast<float>(at.y())});
    }
    if (!mesh->texture_coordinates.empty()) mesh->texture_coordinates.resize(count);
  }
  // Linear by definition, and times the material's.
  if (const int* const colours = Attribute(primitive.attributes, "COLOR_0")) {
    const int width = values_.Width(*colours, "colours of " + where) == 3 ? 3 : 4;
    const std::vector<float> rgb = values_.Floats(*colours, width, "colours of " + where);
    const auto step = static_cast<size_t>(width);
    for (size_t i = 0; i < count && step * i + 2 < rgb.size(); ++i)
      mesh->colours.push_back({Srgb(rgb[step * i]), Srgb(rgb[step * i + 1]), Srgb(rgb[step * i + 2])});
    if (!mesh->colours.empty()) mesh->colours.resize(count, {UINT8_MAX, UINT8_MAX, UINT8_MAX});
  }
}

// The skin as it stands at rest, bound there.
void GltfReader::PlaceByRest(BoundMesh* mesh) const {
  std::vector<Eigen::Vector3d> placed(mesh->positions.size(), Eigen::Vector3d::Zero());
  std::vector<double> sum(placed.size());
  for (const SkinInfluence& influence : mesh->influences) {
    const std::array<float, 3>& v = mesh->positions[influence.vertex];
    const Eigen::Vector4d own(double{v[0]}, double{v[1]}, double{v[2]}, 1);
    placed[influence.vertex] += double{influence.weight} * (rest_[influence.node] * own).head<3>();
    sum[influence.vertex] += double{influence.weight};
  }
  for (size_t i = 0; i < placed.size(); ++i) {
    if (!(sum[i] > 0)) continue;
    const Eigen::Vector3f at = (placed[i] / sum[i]).cast<float>();
    mesh->positions[i] = {at.x(), at.y(), at.z()};
  }
  mesh->own_to_world.setIdentity();
  for (SkinBone& bone : mesh->bones) {
    if (!(std::abs(rest_[bone.node].topLeftCorner<3, 3>().determinant()) >= 1e-12)) {
      Refuse(file_, "a scale of 0 for the joint '" + file_.nodes[bone.node].name + "' of a skin without bind matrices",
             "a scale other than 0");
    }
    bone.inverse_bind = rest_[bone.node].inverse();
  }
}

// The picture of a texture, embedded or a file in the character's folder; -1 for none that can be shown.
int32_t GltfReader::ReadPicture(int texture) {
  if (texture < 0 || static_cast<size_t>(texture) >= model_.textures.size()) return -1;
  const tinygltf::Texture& from = model_.textures[static_cast<size_t>(texture)];
  int source = from.source;
  const auto webp = from.extensions.find("EXT_texture_webp");
  if (source < 0 && webp != from.extensions.end() && webp->second.IsObject() && webp->second.Get("source").IsInt())
    source = webp->second.Get("source").GetNumberAsInt();
  if (source < 0 || static_cast<size_t>(source) >= model_.images.size()) return -1;
  const auto [known, fresh] = pictures_.try_emplace(source, -1);
  if (!fresh) return known->second;
  const tinygltf::Image& image = model_.images[static_cast<size_t>(source)];
  if (image.bufferView >= 0) return known->second = KeepPicture(values_.View(image.bufferView, "a picture"), &file_);
  if (!image.image.empty()) return known->second = KeepPicture(std::as_bytes(std::span(image.image)), &file_);
  const auto bytes = folder_->Read(file_.path.parent_path() / UriPath(image.uri), kMostPictureBytes);
  return bytes ? known->second = KeepPicture(*bytes, &file_) : -1;
}

void GltfReader::ReadMaterials() {
  for (const tinygltf::Material& from : model_.materials) {
    Material material;
    std::vector<double> colour = from.pbrMetallicRoughness.baseColorFactor;
    int texture = from.pbrMetallicRoughness.baseColorTexture.index;
    const auto older = from.extensions.find("KHR_materials_pbrSpecularGlossiness");
    if (older != from.extensions.end() && older->second.IsObject()) {
      const tinygltf::Value& picture = older->second.Get("diffuseTexture");
      const tinygltf::Value& factor = older->second.Get("diffuseFactor");
      texture = picture.IsObject() && picture.Get("index").IsInt() ? picture.Get("index").GetNumberAsInt() : -1;
      colour = {1, 1, 1};
      for (size_t c = 0; factor.IsArray() && c < std::min<size_t>(3, factor.ArrayLen()); ++c)
        colour[c] =
            factor.Get(static_cast<int>(c)).IsNumber() ? factor.Get(static_cast<int>(c)).GetNumberAsDouble() : 1;
    }
    for (size_t c = 0; c < 3; ++c) {
      const auto part = static_cast<float>(colour[c]);
      material.colour[c] = std::isfinite(part) ? std::clamp(part, 0.0f, 1.0f) : 1.0f;
    }
    material.picture = ReadPicture(texture);
    material.cut_out = from.alphaMode != "OPAQUE";
    file_.materials.push_back(material);
  }
}

}  // namespace dcloth::tools
