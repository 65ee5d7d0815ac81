// What the readers of artists' files hand over of a skin, and what becomes of it: one bind pose of the skeleton and
// meshes in it.
#ifndef DCLOTH_TOOLS_CHARACTER_BOUND_MESH_H_
#define DCLOTH_TOOLS_CHARACTER_BOUND_MESH_H_

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/character/character.h"

namespace dcloth::tools {

struct SkinBone {
  size_t node = 0;
  Eigen::Matrix4d inverse_bind;  // from the mesh's own space to the bone's
};

struct BoundMesh {
  std::string name;
  uint32_t material = 0;
  Eigen::Matrix4d own_to_world = Eigen::Matrix4d::Identity();  // in the pose the mesh was bound in
  std::vector<SkinBone> bones;
  std::vector<std::array<float, 3>> positions;            // [v], own space
  std::vector<std::array<uint32_t, 3>> triangles;         // of these vertices, or refused
  std::vector<std::array<float, 2>> texture_coordinates;  // [v] from the upper left; or empty
  std::vector<std::array<uint8_t, 3>> colours;            // [v] sRGB; or empty
  std::vector<SkinInfluence> influences;                  // of these vertices, or refused; finite, 0 or more
};

// Gives the file's bones their bind pose and, where `surfaces`, the file its meshes. Throws converter::Error where two
// meshes bind one bone in two poses, and for numbers and indices that cannot be.
void AddSkins(std::span<const BoundMesh> meshes, bool surfaces, CharacterFile* file);

// Keeps what a browser can show, up to 24 MiB in all: the index in file->pictures, or -1.
int32_t KeepPicture(std::span<const std::byte> bytes, CharacterFile* file);
constexpr size_t kMostPictureBytes = size_t{24} << 20;

uint8_t Srgb(float linear);  // what is not finite is white

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_BOUND_MESH_H_
