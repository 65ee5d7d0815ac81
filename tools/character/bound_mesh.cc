#include "tools/character/bound_mesh.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <string_view>
#include <utility>

#include "tools/character/matrix_values.h"

namespace dcloth::tools {
namespace {

constexpr double kSameBind = 1e-3;  // of a bind pose that two meshes give one bone
constexpr size_t kMostVertices = size_t{1} << 24, kMostTriangles = size_t{1} << 25;

bool IsSameBind(const Eigen::Matrix4d& a, const Eigen::Matrix4d& b) {
  return (a - b).cwiseAbs().maxCoeff() <= kSameBind * std::max(1.0, b.cwiseAbs().maxCoeff());
}

// A mesh may lie in a space of its own, as an eye in its head's: then the same map takes its bones to the bind pose
// that other meshes gave them.
Eigen::Matrix4d MeshToWorld(const BoundMesh& mesh, const CharacterFile& file) {
  std::optional<Eigen::Matrix4d> told;
  bool fits = true;
  for (const SkinBone& bone : mesh.bones) {
    const std::optional<Eigen::Matrix4d>& known = file.nodes[bone.node].bind;
    if (!known) continue;
    if (!told) told = *known * bone.inverse_bind;
    if (!IsSameBind(*told * bone.inverse_bind.inverse(), *known)) return mesh.own_to_world;
    fits = fits && IsSameBind(mesh.own_to_world * bone.inverse_bind.inverse(), *known);
  }
  return told && !fits ? *told : mesh.own_to_world;
}

void AddBind(const BoundMesh& mesh, CharacterFile* file) {
  for (const SkinBone& bone : mesh.bones) {
    if (std::abs(bone.inverse_bind.topLeftCorner<3, 3>().determinant()) >= 1e-12) continue;
    Refuse(*file, "a bind matrix that has no inverse for bone '" + file->nodes[bone.node].name + "'",
           "an invertible matrix");
  }
  const Eigen::Matrix4d to_world = MeshToWorld(mesh, *file);
  for (const SkinBone& bone : mesh.bones) {
    const Eigen::Matrix4d bind = to_world * bone.inverse_bind.inverse();
    std::optional<Eigen::Matrix4d>& known = file->nodes[bone.node].bind;
    // Meshes of one skeleton agree, or no pose fits the file.
    if (known && !IsSameBind(*known, bind)) {
      Refuse(*file, "a second bind pose of bone '" + file->nodes[bone.node].name + "' in mesh '" + mesh.name + "'",
             "one bind pose", "bind all meshes in the same pose, or export only the body");
    }
    if (!known) known = bind;
  }
}

// Readers cut a mesh at every face; vertices on the same place are one again.
SkinnedMesh Welded(const BoundMesh& mesh, const CharacterFile& file) {
  SkinnedMesh out;
  out.name = mesh.name;
  out.material = mesh.material;
  if (mesh.positions.size() > kMostVertices || mesh.triangles.size() > kMostTriangles)
    Refuse(file, "a mesh '" + mesh.name + "' of more than 2^24 vertices", "at most 2^24");
  const Eigen::Matrix4d to_world = MeshToWorld(mesh, file);
  std::map<std::array<float, 3>, uint32_t> place;
  std::vector<uint32_t> vertex_of(mesh.positions.size());
  for (size_t i = 0; i < vertex_of.size(); ++i) {
    const std::array<float, 3>& v = mesh.positions[i];
    for (const float x : v) CheckNumber(file, static_cast<double>(x), "vertices of mesh '" + mesh.name + "'");
    const auto [at, fresh] = place.try_emplace(v, static_cast<uint32_t>(out.positions.size()));
    if (fresh) {
      const Eigen::Vector4d own(double{v[0]}, double{v[1]}, double{v[2]}, 1);
      out.positions.emplace_back((to_world * own).head<3>());
    }
    vertex_of[i] = at->second;
  }
  for (const std::array<uint32_t, 3>& triangle : mesh.triangles) {
    std::array<uint32_t, 3> corner;
    for (size_t k = 0; k < 3; ++k) {
      if (triangle[k] >= vertex_of.size()) {
        Refuse(file, "a face of mesh '" + mesh.name + "' with a vertex that does not exist",
               "indices below the vertex count");
      }
      corner[k] = vertex_of[triangle[k]];
    }
    if (corner[0] == corner[1] || corner[1] == corner[2] || corner[2] == corner[0]) continue;
    out.triangles.insert(out.triangles.end(), corner.begin(), corner.end());
    for (size_t k = 0; !mesh.texture_coordinates.empty() && k < 3; ++k) {
      const auto& [u, v] = mesh.texture_coordinates[triangle[k]];
      const bool sound = std::isfinite(u) && std::isfinite(v);
      out.texture_coordinates.push_back(sound ? u : 0);
      out.texture_coordinates.push_back(sound ? v : 0);
    }
    for (size_t k = 0; !mesh.colours.empty() && k < 3; ++k) {
      const std::array<uint8_t, 3>& colour = mesh.colours[triangle[k]];
      out.colours.insert(out.colours.end(), colour.begin(), colour.end());
    }
  }
  std::map<std::pair<uint32_t, uint32_t>, float> weights;  // (vertex, node): copies of a vertex agree
  for (const SkinInfluence& influence : mesh.influences) {
    if (influence.vertex >= vertex_of.size() || !std::isfinite(influence.weight) || influence.weight < 0) {
      Refuse(
          file,
          "a weight of bone '" + file.nodes[influence.node].name + "' that is negative or not finite, or has no vertex",
          "finite weights of 0 or more for vertices of the mesh");
    }
    if (influence.weight > 0) weights[{vertex_of[influence.vertex], influence.node}] = influence.weight;
  }
  for (const auto& [key, weight] : weights) out.influences.push_back({key.first, key.second, weight});
  return out;
}

bool IsPicture(std::span<const std::byte> bytes) {
  const auto begins = [&](std::string_view with, size_t at) {
    return bytes.size() >= at + with.size() && std::memcmp(bytes.data() + at, with.data(), with.size()) == 0;
  };
  return begins("\x89PNG", 0) || begins("\xFF\xD8\xFF", 0) || (begins("RIFF", 0) && begins("WEBP", 8));
}

}  // namespace

void AddSkins(std::span<const BoundMesh> meshes, bool surfaces, CharacterFile* file) {
  // Meshes with few bones follow those with many: what an eye is bound in says little of the body.
  std::vector<const BoundMesh*> by_bones;
  for (const BoundMesh& mesh : meshes) by_bones.push_back(&mesh);
  std::ranges::stable_sort(by_bones, std::ranges::greater(), [](const BoundMesh* mesh) { return mesh->bones.size(); });
  for (const BoundMesh* mesh : by_bones) AddBind(*mesh, file);
  for (const BoundMesh& mesh : meshes) {
    if (surfaces) file->meshes.push_back(Welded(mesh, *file));
  }
}

int32_t KeepPicture(std::span<const std::byte> bytes, CharacterFile* file) {
  size_t held = 0;
  for (const auto& picture : file->pictures) held += picture.size();
  if (!IsPicture(bytes) || bytes.size() > kMostPictureBytes - held) return -1;
  file->pictures.emplace_back(bytes.begin(), bytes.end());
  return static_cast<int32_t>(file->pictures.size() - 1);
}

uint8_t Srgb(float linear) {
  const float sound = std::isfinite(linear) ? std::clamp(linear, 0.0f, 1.0f) : 1.0f;
  return static_cast<uint8_t>(std::lround(255 * std::pow(sound, 1 / 2.2f)));
}

}  // namespace dcloth::tools
