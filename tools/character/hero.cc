#include "tools/character/hero.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <memory>
#include <span>
#include <unordered_map>

#include "converter/error.h"
#include "converter/file.h"
#include "tools/character/character_pose.h"
#include "tools/character/matrix_values.h"

namespace dcloth::tools {
namespace {

constexpr size_t kMostJoints = 4096, kMostVertices = size_t{1} << 24;
constexpr size_t kInfluences = 4;
constexpr size_t kLeastMatched = 5;
constexpr double kSameWay = 25;  // degrees between a bone of two skeletons that rest in one stance
constexpr double kArmsApart =
    80;  // the same for arms, of a T pose and of one whose arms hang: the latter are twisted too

uint32_t RoleOfKey(const std::string& key) {
  for (uint32_t role = 1; dcloth_role_name(role) != nullptr; ++role) {
    if (key == dcloth_role_name(role)) return role;
  }
  return dcloth_role_of_name(key.c_str());
}

std::string RoleNames() {
  std::string names;
  for (uint32_t role = 1; dcloth_role_name(role) != nullptr; ++role)
    names.append(role == 1 ? "'" : ", '").append(dcloth_role_name(role)).append("'");
  return names;
}

// Joints in the order of the file's nodes: bones of the skin and what is named.
void ChooseJoints(const CharacterFile& file, const JointMap& map, Hero* hero) {
  std::unordered_map<std::string, uint32_t> told(file.roles.begin(), file.roles.end());
  for (const auto& [key, node] : map) {
    const uint32_t role = RoleOfKey(key);
    if (role == DCLOTH_ROLE_NONE) {
      Refuse(file, "the unknown name '" + key + "' in --map", "a joint of the garment, or one of " + RoleNames(), "");
    }
    if (std::ranges::none_of(file.nodes,
                             [&wanted = node](const CharacterNode& other) { return other.name == wanted; })) {
      std::vector<std::string> held;
      for (const CharacterNode& other : file.nodes) held.push_back(other.name);
      std::string closest, found = "no node '";
      for (const std::string& name : NearestNames(node, held, 3))
        closest += (closest.empty() ? "'" : ", '") + name + "'";
      found.append(node).append("', which --map names for '").append(key).append("'");
      Refuse(file, found, "the name of a node in the file", closest.empty() ? "" : "the closest names are " + closest);
    }
    std::erase_if(told, [&](const auto& other) { return other.second == role; });
    told[node] = role;
  }
  const bool skin = std::ranges::any_of(file.nodes, [](const CharacterNode& node) { return node.bind.has_value(); });
  for (size_t i = 0; i < file.nodes.size(); ++i) {
    const CharacterNode& node = file.nodes[i];
    const auto role = told.find(node.name);
    if (node.helper || (skin && !node.bind && role == told.end())) continue;
    hero->joints.push_back(node.name);
    hero->nodes.push_back(i);
    hero->roles.push_back(role == told.end() ? uint32_t{DCLOTH_ROLE_NONE} : role->second);
  }
  if (hero->nodes.empty() || hero->nodes.size() > kMostJoints) {
    Refuse(file, std::to_string(hero->nodes.size()) + " joints", "1 to 4096 bones",
           "export the character with its skeleton");
  }
}

void AddMesh(const CharacterFile& file, const SkinnedMesh& mesh, const std::vector<uint32_t>& joint_of, Hero* hero) {
  const size_t first = hero->positions.size() / 3;
  if (first + mesh.positions.size() > kMostVertices)
    Refuse(file, "a skin of more than 2^24 vertices", "at most 2^24", "");
  std::vector<std::array<std::pair<float, uint32_t>, kInfluences>> best(mesh.positions.size());
  for (auto& row : best) row.fill({0.0f, 0});
  for (const SkinInfluence& influence : mesh.influences) {
    auto& row = best[influence.vertex];
    const std::pair<float, uint32_t> entry = {influence.weight, joint_of[influence.node]};
    if (entry.second == UINT32_MAX || entry.first <= row.back().first) continue;
    row.back() = entry;
    std::ranges::sort(row, [](const auto& a, const auto& b) { return a.first > b.first; });
  }
  // A vertex that no joint holds goes with the joint of its neighbours: the mesh's first.
  for (size_t v = 0; v < mesh.positions.size(); ++v) {
    const Eigen::Vector3d placed = (hero->from_bind * mesh.positions[v].homogeneous()).head<3>();
    const Eigen::Vector3f point = hero->space.Point(placed).cast<float>();
    if (!point.allFinite()) RefuseNumbers(file, "a vertex of mesh '" + mesh.name + "'");
    hero->positions.insert(hero->positions.end(), point.begin(), point.end());
    float sum = 0;
    for (const auto& [weight, joint] : best[v]) sum += weight;
    for (size_t k = 0; k < kInfluences; ++k) {
      hero->influences.push_back(sum > 0 ? best[v][k].second : 0);
      hero->weights.push_back(sum > 0 ? best[v][k].first / sum : k == 0 ? 1.0f : 0.0f);
    }
  }
  if (!mesh.colours.empty() || !hero->colours.empty()) hero->colours.resize(3 * hero->triangles.size(), UINT8_MAX);
  for (const uint32_t corner : mesh.triangles) hero->triangles.push_back(static_cast<uint32_t>(first) + corner);
  hero->materials.resize(hero->triangles.size() / 3, mesh.material);
  hero->texture_coordinates.insert(hero->texture_coordinates.end(), mesh.texture_coordinates.begin(),
                                   mesh.texture_coordinates.end());
  hero->texture_coordinates.resize(2 * hero->triangles.size());
  hero->colours.insert(hero->colours.end(), mesh.colours.begin(), mesh.colours.end());
  if (!hero->colours.empty()) hero->colours.resize(3 * hero->triangles.size(), UINT8_MAX);
}

// Names without prefix, case and separators, so that clips of one maker fit all of its characters; and roles.
struct Names {
  std::unordered_map<std::string, size_t> words;
  std::map<uint32_t, size_t> roles;
};

std::string Word(const std::string& name) {
  const size_t colon = name.find_last_of(":|");
  std::string word;
  for (const char c : name.substr(colon == std::string::npos ? 0 : colon + 1)) {
    if (c >= 'A' && c <= 'Z') word += static_cast<char>(c - 'A' + 'a');
    if ((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || static_cast<unsigned char>(c) >= 0x80) word += c;
  }
  if (word.starts_with("mixamorig")) {
    size_t at = 9;
    while (at < word.size() && word[at] >= '0' && word[at] <= '9') ++at;
    word.erase(0, at);
  }
  return word;
}

Names NamesOf(const CharacterFile& file) {
  Names names;
  const std::vector<std::string> own = OwnNames(file);
  const std::vector<uint32_t> roles = NodeRoles(file);
  for (size_t i = 0; i < file.nodes.size(); ++i) {
    if (file.nodes[i].helper) continue;
    names.words.emplace(Word(own[i]), i);
    if (roles[i] != DCLOTH_ROLE_NONE) names.roles.emplace(roles[i], i);
  }
  return names;
}

double Degrees(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(a.normalized().dot(b.normalized()), -1.0, 1.0)) * 180 / EIGEN_PI;
}

Eigen::Matrix3d Rotation(const Eigen::Matrix4d& matrix) {
  Eigen::Matrix3d out = matrix.topLeftCorner<3, 3>();
  for (int c = 0; c < 3; ++c) out.col(c).normalize();
  return out;
}

// The source's node for each node of the hero's file that has one; -1 where there is none.
std::vector<int64_t> MatchNodes(const CharacterFile& file, const CharacterFile& source) {
  const Names names = NamesOf(source);
  const std::vector<std::string> own = OwnNames(file);
  const std::vector<uint32_t> roles = NodeRoles(file);
  std::vector<int64_t> match(file.nodes.size(), -1);
  for (size_t i = 0; i < match.size(); ++i) {
    if (file.nodes[i].helper) continue;
    const auto word = names.words.find(Word(own[i]));
    const auto role = names.roles.find(roles[i]);
    if (word != names.words.end())
      match[i] = static_cast<int64_t>(word->second);
    else if (role != names.roles.end())
      match[i] = static_cast<int64_t>(role->second);
  }
  return match;
}

// The hero's nodes in a pose of another file's skeleton, in the hero's world (metres, +Y up).
class OtherSkeleton {
 public:
  OtherSkeleton(const CharacterFile& file, const Hero& hero, const CharacterFile& source, const CharacterClip& clip)
      : file_(file),
        hero_(hero),
        source_(source),
        clip_(clip),
        roles_(NodeRoles(file)),
        match_(MatchNodes(file, source)) {
    const std::vector<std::string> own_names = OwnNames(file);
    size_t matched = 0;
    for (const int64_t node : match_) matched += node >= 0 ? 1 : 0;
    hips_ = match_.size();
    for (size_t i = 0; i < match_.size(); ++i) {
      const std::string word = Word(own_names[i]);
      if (match_[i] >= 0 && (hips_ == match_.size() || word == "hips" || word == "pelvis") &&
          roles_[i] == DCLOTH_ROLE_HIPS)
        hips_ = i;
    }
    if (matched < kLeastMatched || hips_ == match_.size()) {
      Refuse(source, "a skeleton that shares " + std::to_string(matched) + " joint names with the character",
             "at least 5 shared names, the hips among them",
             "pass an animation that was made for this kind of skeleton");
    }
    source_space_ = SpaceOf(source, {}, {});
    // Whose unit a file of animation alone does not always tell: hips stand as high as their legs are long.
    const auto rest = RestMatrices(source);
    const double own = hero.rest[hips_](1, 3);
    double theirs = source_space_.World(rest[static_cast<size_t>(match_[hips_])])(1, 3);
    if (std::abs(theirs) < 1e-3) {
      const auto first = WorldMatrices(source, &clip, clip.first_seconds);
      theirs = source_space_.World(first[static_cast<size_t>(match_[hips_])])(1, 3);
    }
    size_ = std::abs(theirs) > 1e-3 ? std::abs(own / theirs) : 1;
    CompareRests();
  }

  std::vector<Eigen::Matrix4d> Pose(double seconds) const {
    const auto world = WorldMatrices(source_, &clip_, seconds);
    std::vector<Eigen::Matrix4d> out(file_.nodes.size());
    // The nearest matched node above, in the hero's file.
    for (size_t i = 0; i < out.size(); ++i) {
      const int32_t parent = file_.nodes[i].parent;
      const Eigen::Matrix4d above = parent >= 0 ? out[static_cast<size_t>(parent)] : Eigen::Matrix4d::Identity();
      const Eigen::Matrix4d rest_above =
          parent >= 0 ? hero_.rest[static_cast<size_t>(parent)] : Eigen::Matrix4d::Identity();
      out[i] = above * rest_above.inverse() * hero_.rest[i];
      if (match_[i] < 0 || (i != hips_ && !UnderHips(i))) continue;
      const Eigen::Matrix4d theirs = source_space_.World(world[static_cast<size_t>(match_[i])]);
      const Eigen::Vector3d scale = hero_.rest[i].topLeftCorner<3, 3>().colwise().norm();
      const Eigen::Matrix3d to_own =
          same_rest_ ? Eigen::Matrix3d(Rotation(their_rest_[i]).transpose() * arm_turn_[i] * Rotation(hero_.rest[i]))
                     : Eigen::Matrix3d::Identity();
      out[i].topLeftCorner<3, 3>() = Rotation(theirs) * to_own * scale.asDiagonal();
      if (i == hips_) out[i].topRightCorner<3, 1>() = size_ * theirs.topRightCorner<3, 1>();
    }
    return out;
  }

 private:
  uint32_t RoleOf(size_t node) const { return roles_[node]; }

  // The joint above that both skeletons have and that is a part of the body; below 0 for none.
  int64_t PartAbove(size_t node) const {
    int64_t above = file_.nodes[node].parent;
    while (above >= 0 &&
           (match_[static_cast<size_t>(above)] < 0 || RoleOf(static_cast<size_t>(above)) == DCLOTH_ROLE_NONE))
      above = file_.nodes[static_cast<size_t>(above)].parent;
    return above;
  }

  // Where both rest in one stance, a joint's axes are told by the two rests. Arms may hang lower in one of them (a T
  // pose and an A pose), and collar bones rise: they are turned from one to the other the shortest way. Where the other
  // file's nodes rest in a pose of its animation, the axes of one maker's joints are taken to be the same on all of its
  // characters.
  void CompareRests() {
    const auto rest = RestMatrices(source_);
    their_rest_.assign(match_.size(), Eigen::Matrix4d::Identity());
    arm_turn_.assign(match_.size(), Eigen::Matrix3d::Identity());
    for (size_t i = 0; i < match_.size(); ++i) {
      if (match_[i] >= 0) their_rest_[i] = source_space_.World(rest[static_cast<size_t>(match_[i])]);
    }
    std::vector<Eigen::Matrix3d> arm_turn = arm_turn_;
    size_t same = 0, same_but_arms = 0, same_axes = 0, compared = 0;
    for (size_t i = 0; i < match_.size(); ++i) {
      const uint32_t role = RoleOf(i);
      if (match_[i] < 0 || role == DCLOTH_ROLE_NONE || PartAbove(i) < 0) continue;
      const auto a = static_cast<size_t>(PartAbove(i));
      // Where a leg begins beside the hips is a matter of build.
      if (role == DCLOTH_ROLE_LEFT_UPPER_LEG || role == DCLOTH_ROLE_RIGHT_UPPER_LEG) continue;
      const Eigen::Vector3d own = (hero_.rest[i] - hero_.rest[a]).topRightCorner<3, 1>();
      const Eigen::Vector3d theirs = (their_rest_[i] - their_rest_[a]).topRightCorner<3, 1>();
      if (own.norm() < 0.02 || theirs.norm() * size_ < 0.02) continue;
      ++compared;
      const uint32_t above = RoleOf(a);
      const bool arm = (above >= DCLOTH_ROLE_LEFT_SHOULDER && above <= DCLOTH_ROLE_LEFT_LOWER_ARM) ||
                       (above >= DCLOTH_ROLE_RIGHT_SHOULDER && above <= DCLOTH_ROLE_RIGHT_LOWER_ARM);
      same += Degrees(own, theirs) < kSameWay ? 1 : 0;
      same_but_arms += Degrees(own, theirs) < (arm ? kArmsApart : kSameWay) ? 1 : 0;
      if (arm) arm_turn[a] = Eigen::Quaterniond::FromTwoVectors(own, theirs).toRotationMatrix();
      // Where the bone lies in its joint's own axes, which no pose changes.
      same_axes +=
          Degrees(Rotation(hero_.rest[a]).transpose() * own, Rotation(their_rest_[a]).transpose() * theirs) < kSameWay
              ? 1
              : 0;
    }
    same_rest_ = compared != 0 && 10 * same >= 9 * compared;
    if (same_rest_ || 10 * same_axes >= 9 * compared) return;
    same_rest_ = 10 * same_but_arms >= 9 * compared;
    if (same_rest_) return TurnArms(arm_turn);
    Refuse(source_, "joints whose axes and rest pose both differ from the character's",
           "the same axes, or a rest pose that is the character's T or A pose",
           "export the animation with its skin, or with the bind pose as its rest pose");
  }

  // Hands and fingers go with the lower arm.
  void TurnArms(const std::vector<Eigen::Matrix3d>& arm_turn) {
    arm_turn_ = arm_turn;
    for (size_t i = 0; i < match_.size(); ++i) {
      for (int64_t at = static_cast<int64_t>(i); at >= 0; at = file_.nodes[static_cast<size_t>(at)].parent) {
        const auto node = static_cast<size_t>(at);
        const uint32_t role = RoleOf(node);
        if (role != DCLOTH_ROLE_LEFT_LOWER_ARM && role != DCLOTH_ROLE_RIGHT_LOWER_ARM) continue;
        arm_turn_[i] = arm_turn_[node];
        break;
      }
    }
  }

  bool UnderHips(size_t node) const {
    for (int64_t at = static_cast<int64_t>(node); at >= 0; at = file_.nodes[static_cast<size_t>(at)].parent) {
      if (static_cast<size_t>(at) == hips_) return true;
    }
    return false;
  }

  const CharacterFile& file_;
  const Hero& hero_;
  const CharacterFile& source_;
  const CharacterClip& clip_;
  std::vector<uint32_t> roles_;  // [nodes of the hero's file]
  std::vector<int64_t> match_;
  size_t hips_ = 0;
  CharacterSpace source_space_;
  double size_ = 1;
  std::vector<Eigen::Matrix4d> their_rest_;  // [nodes of the hero's file], metres, +Y up
  std::vector<Eigen::Matrix3d> arm_turn_;    // [nodes of the hero's file], from the hero's rest to theirs
  bool same_rest_ = false;
};

// Skins are bound in a space of their mesh's, which may be in centimetres with +Z up where the nodes turn and scale it;
// and nodes may stand in a pose other than that of the skin. Between the two there are axes and a unit, which a joint's
// two matrices tell: the turn is rounded to axes, since the rest of it is the pose.
std::vector<Eigen::Matrix4d> StandingRest(const CharacterFile& file, Hero* hero) {
  const std::vector<Eigen::Matrix4d> nodes = WorldMatrices(file, nullptr, 0);
  std::vector<Eigen::Matrix4d> rest = RestMatrices(file);
  const std::vector<uint32_t> roles = NodeRoles(file);
  std::optional<Eigen::Matrix4d> from_bind;
  for (const size_t node : hero->nodes) {
    if (!file.nodes[node].bind) continue;
    const bool hips = roles[node] == DCLOTH_ROLE_HIPS;
    if (from_bind && !hips) continue;
    from_bind = nodes[node] * file.nodes[node].bind->inverse();
    if (hips) break;
  }
  if (!from_bind) return rest;
  const double scale = std::cbrt(std::abs(from_bind->topLeftCorner<3, 3>().determinant()));
  Eigen::Matrix3d turn = Eigen::Matrix3d::Zero();
  for (int c = 0; c < 3; ++c) {
    Eigen::Index row = 0;
    from_bind->col(c).head<3>().cwiseAbs().maxCoeff(&row);
    turn(row, c) = (*from_bind)(row, c) < 0 ? -1 : 1;
  }
  if (std::abs(turn.determinant() - 1) > 1e-9 || !(scale > 1e-6 && scale < 1e6)) return rest;
  if (turn.isIdentity() && std::abs(scale - 1) < 0.02) return rest;
  hero->from_bind.setIdentity();
  hero->from_bind.topLeftCorner<3, 3>() = scale * turn;
  for (size_t i = 0; i < rest.size(); ++i) {
    if (file.nodes[i].bind) rest[i] = hero->from_bind * rest[i];
  }
  return rest;
}

// Metres in a unit, as text. Files that were scaled on their way say metres and mean something else: no body spans 18
// m.
std::string LikelyUnit(const CharacterFile& file, std::span<const Eigen::Matrix4d> joints) {
  constexpr double kLeast = 0.3, kMost = 4;  // metres, of the joints of a child and of a giant
  Eigen::AlignedBox3d box;
  for (const Eigen::Matrix4d& joint : joints) box.extend(Eigen::Vector3d(joint.topRightCorner<3, 1>()));
  const double said = file.metres_per_unit.value_or(1.0), span = said * box.sizes().maxCoeff();
  if (joints.size() < 2 || !(span > 1e-6 && span < 1e6)) return {};
  double unit = said;
  while (span / said * unit > kMost) unit /= 10;
  while (span / said * unit < kLeast) unit *= 10;
  if (unit == said) return {};
  char text[40];
  std::snprintf(text, sizeof text, "%.9g", unit);
  std::fprintf(
      stderr, "note: joints span %.3g m by the file's unit; read with %s m in a unit instead (--unit says otherwise)\n",
      span, text);
  return text;
}

const CharacterClip& FindClip(const CharacterFile& file, const std::string& wanted) {
  std::string held;
  for (size_t i = 0; i < file.clips.size(); ++i) {
    if (file.clips[i].name == wanted || std::to_string(i) == wanted) return file.clips[i];
    held += (i == 0 ? "'" : ", '") + file.clips[i].name + "'";
  }
  throw converter::Error({.path = file.path,
                          .tensor = {},
                          .found = "no clip '" + wanted + "'; the file has " + (held.empty() ? "none" : held),
                          .expected = "the name or number of a clip in the file",
                          .mend = "pass --animation NAME, or another file: --animation walk.fbx"});
}

std::vector<float> JointsIn(const std::vector<Eigen::Matrix4d>& world, const Hero& hero, const CharacterFile& source,
                            size_t frame) {
  std::vector<float> out;
  out.reserve(16 * hero.nodes.size());
  for (size_t j = 0; j < hero.nodes.size(); ++j) {
    if (!AppendMatrix(world[hero.nodes[j]], &out))
      RefuseNumbers(source, "joint '" + hero.joints[j] + "', frame " + std::to_string(frame));
  }
  return out;
}

HeroClip Unposed(const CharacterClip& clip, double fps) {
  HeroClip out;
  out.name = clip.name;
  out.fps = fps;
  out.frames = static_cast<size_t>(std::floor((clip.last_seconds - clip.first_seconds) * fps + 1e-3)) + 1;
  return out;
}

HeroClip OwnClip(const CharacterFile& file, const Hero& hero, const CharacterClip& clip, double fps) {
  HeroClip out = Unposed(clip, fps);
  out.pose = [&file, &hero, &clip, fps](size_t frame) {
    std::vector<Eigen::Matrix4d> world =
        WorldMatrices(file, &clip, clip.first_seconds + static_cast<double>(frame) / fps);
    for (const size_t node : hero.nodes) world[node] = hero.space.World(world[node]);
    return JointsIn(world, hero, file, frame);
  };
  return out;
}

// What no garment can be put on, in words that say why.
void CheckBody(const CharacterFile& file, const Hero& hero) {
  const bool skin = std::ranges::any_of(file.nodes, [](const CharacterNode& node) { return node.bind.has_value(); });
  if (!skin && file.loose_meshes != 0) {
    Refuse(file,
           "a character without a skin: none of " + std::to_string(file.loose_meshes) + " meshes is bound to joints",
           "a mesh with joints and weights", "bind the mesh to its skeleton and export both");
  }
  const std::vector<Eigen::Matrix4d> world = WorldMatrices(file, nullptr, 0);
  const auto mirrors = [](const Eigen::Matrix4d& matrix) { return matrix.topLeftCorner<3, 3>().determinant() < 0; };
  const auto mirrored =
      static_cast<size_t>(std::ranges::count_if(hero.nodes, [&](size_t node) { return mirrors(world[node]); }));
  if (2 * mirrored <= hero.nodes.size()) return;
  size_t root = hero.nodes.front();
  while (file.nodes[root].parent >= 0 && mirrors(world[static_cast<size_t>(file.nodes[root].parent)]))
    root = static_cast<size_t>(file.nodes[root].parent);
  Refuse(file, "a mirrored character: the scale of node '" + file.nodes[root].name + "' has a negative product",
         "scales above 0", "apply the scale to the mesh and the skeleton and export again");
}

}  // namespace

std::vector<uint32_t> NodeRoles(const CharacterFile& file) {
  const std::unordered_map<std::string, uint32_t> told(file.roles.begin(), file.roles.end());
  const std::vector<std::string> own = OwnNames(file);
  std::vector<uint32_t> roles;
  for (size_t i = 0; i < own.size(); ++i) {
    const auto role = told.find(file.nodes[i].name);
    uint32_t by_name = dcloth_role_of_name(own[i].c_str());
    if (by_name == DCLOTH_ROLE_NONE) by_name = dcloth_role_of_name(file.nodes[i].name.c_str());
    roles.push_back(role != told.end() ? role->second : by_name);
  }
  return roles;
}

Hero ReadHero(const CharacterFile& file, const JointMap& map, const SpaceOptions& options) {
  Hero hero;
  ChooseJoints(file, map, &hero);
  CheckBody(file, hero);
  const std::vector<Eigen::Matrix4d> rest = StandingRest(file, &hero);
  std::vector<Eigen::Matrix4d> joints;
  for (const size_t node : hero.nodes) joints.push_back(rest[node]);
  SpaceOptions asked = options;
  if (asked.unit.empty()) asked.unit = LikelyUnit(file, joints);
  hero.space = SpaceOf(file, asked, joints);
  for (const Eigen::Matrix4d& node : rest) hero.rest.push_back(hero.space.World(node));
  for (size_t j = 0; j < hero.nodes.size(); ++j) {
    if (!AppendMatrix(hero.rest[hero.nodes[j]], &hero.bind))
      RefuseNumbers(file, "joint '" + hero.joints[j] + "' at rest");
  }
  std::vector<uint32_t> joint_of(file.nodes.size(), UINT32_MAX);
  for (size_t j = 0; j < hero.nodes.size(); ++j) joint_of[hero.nodes[j]] = static_cast<uint32_t>(j);
  for (const SkinnedMesh& mesh : file.meshes) AddMesh(file, mesh, joint_of, &hero);
  return hero;
}

dcloth_character CharacterOf(const Hero& hero, std::vector<const char*>* names) {
  names->clear();
  for (const std::string& name : hero.joints) names->push_back(name.c_str());
  dcloth_character character{};
  character.struct_size = sizeof(character);
  character.joint_count = static_cast<uint32_t>(hero.joints.size());
  character.joint_names = names->data();
  character.joint_roles = hero.roles.data();
  character.bind_matrices = hero.bind.data();
  character.body_vertex_count = static_cast<uint32_t>(hero.positions.size() / 3);
  character.body_positions = hero.positions.data();
  character.body_joints = hero.influences.data();
  character.body_weights = hero.weights.data();
  character.body_influences = kInfluences;
  character.body_triangles = hero.triangles.empty() ? nullptr : hero.triangles.data();
  character.body_triangle_count = static_cast<uint32_t>(hero.triangles.size() / 3);
  return character;
}

HeroClip FirstClip(const CharacterFile& file, const Hero& hero, double fps) {
  return OwnClip(file, hero, file.clips.front(), fps);
}

HeroClip ReadAnimation(const std::string& animation, const CharacterFile& file, const Hero& hero, double fps) {
  std::filesystem::path path = animation;
  std::string clip;
  std::error_code failed;
  if (!std::filesystem::is_regular_file(path, failed)) {
    const size_t mark = animation.rfind('#');
    if (mark != std::string::npos) {
      path = animation.substr(0, mark);
      clip = animation.substr(mark + 1);
    }
    if (!std::filesystem::is_regular_file(path, failed)) return OwnClip(file, hero, FindClip(file, animation), fps);
  }
  const auto held = std::make_shared<const CharacterFile>(ReadCharacter(path, false));
  const CharacterFile& source = *held;
  if (clip.empty() && source.clips.empty()) {
    throw converter::Error({.path = path,
                            .tensor = {},
                            .found = "no animation",
                            .expected = "a clip",
                            .mend = "export it with its animation baked to keys"});
  }
  const CharacterClip& chosen = clip.empty() ? source.clips.front() : FindClip(source, clip);
  HeroClip out = Unposed(chosen, fps);
  out.name = converter::PathText(path.stem()) + (source.clips.size() > 1 ? ", " + chosen.name : "");
  const auto other = std::make_shared<const OtherSkeleton>(file, hero, source, chosen);
  out.pose = [held, other, &hero, first = chosen.first_seconds, fps](size_t frame) {
    return JointsIn(other->Pose(first + static_cast<double>(frame) / fps), hero, *held, frame);
  };
  return out;
}

HeroClip StandStill(const Hero& hero, double fps, size_t frames) {
  HeroClip out;
  out.name = "bind pose";
  out.fps = fps;
  out.frames = frames;
  out.pose = [&hero](size_t) { return hero.bind; };
  return out;
}

}  // namespace dcloth::tools
