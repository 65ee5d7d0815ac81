// An animated, skinned character as a file tells it: nodes, keys, the skin's bind pose. In the file's own axes and
// unit.
#ifndef DCLOTH_TOOLS_CHARACTER_CHARACTER_H_
#define DCLOTH_TOOLS_CHARACTER_CHARACTER_H_

#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace dcloth::tools {

struct CharacterNode {
  std::string name;
  int32_t parent = -1;                  // -1 at the root; parents stand before their children
  Eigen::Matrix4d local;                // to the parent's space, without animation
  std::optional<Eigen::Matrix4d> bind;  // to world, in the pose the skin was bound in; bones of a skin only
  bool helper = false;                  // a step of another node's transform, not a joint of its own
};

// A value over time: straight between keys (rotations on the arc), unless one of the two below says otherwise.
template <typename Value>
struct Curve {
  std::vector<std::pair<double, Value>> keys = {};  // seconds, ascending
  std::vector<std::array<Value, 2>> tangents = {};  // [keys], in and out, a second: cubic Hermite splines
  bool holds = false;                               // each key until the next one
};

struct NodeChannel {
  size_t node = 0;
  Curve<Eigen::Vector3d> positions = {}, scales = {};
  Curve<Eigen::Quaterniond> rotations = {};  // keys of length 1
};

struct CharacterClip {
  std::string name;
  std::vector<NodeChannel> channels;
  double first_seconds = 0, last_seconds = 0;  // of the keys
};

struct SkinInfluence {
  uint32_t vertex = 0;
  uint32_t node = 0;
  float weight = 0;
};

// What a surface looks like, as far as a page shows it.
struct Material {
  std::array<float, 3> colour = {1, 1, 1};  // linear; times the picture
  int32_t picture = -1;                     // of CharacterFile::pictures; -1 for none
  bool cut_out = false;                     // nothing is drawn where the picture is transparent
};

struct SkinnedMesh {
  std::string name;
  uint32_t material = 0;
  std::vector<float> texture_coordinates;  // [c, 3, 2] of the triangles' corners, from the upper left; or empty
  std::vector<uint8_t> colours;            // [c, 3, 3] of the corners, sRGB; or empty
  std::vector<Eigen::Vector3d> positions;  // world, in the bind pose
  std::vector<uint32_t> triangles;         // [c, 3]
  std::vector<SkinInfluence> influences;
};

struct CharacterFile {
  std::filesystem::path path;
  std::string format;  // "glTF", "FBX" or "BVH"
  std::vector<CharacterNode> nodes;
  std::vector<CharacterClip> clips;
  std::vector<SkinnedMesh> meshes;
  size_t loose_meshes = 0;  // without a skin, not among `meshes`
  std::vector<Material> materials;
  std::vector<std::vector<std::byte>> pictures;         // PNG, JPEG or WebP, unread
  std::vector<std::pair<std::string, uint32_t>> roles;  // node, DCLOTH_ROLE_*: where the file says so (VRM)
  std::optional<double> metres_per_unit;                // where the file says so
  Eigen::Matrix3d upright;                              // the file's axes to +Y up, +Z front
};

// Reads .gltf, .glb, .vrm, .vrma, .fbx or .bvh; other files are opened only where the first one names them and only in
// its folder. What comes back is checked: finite numbers, keys in order, counts, depth, names. `meshes` false leaves
// meshes out. Throws converter::Error; for FBX and BVH also in a build without assimp.
CharacterFile ReadCharacter(const std::filesystem::path& path, bool meshes);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_CHARACTER_H_
