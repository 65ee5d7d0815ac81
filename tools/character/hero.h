// A character of a file as the engine fits a garment to it, and its poses in clips of this file and of others.
#ifndef DCLOTH_TOOLS_CHARACTER_HERO_H_
#define DCLOTH_TOOLS_CHARACTER_HERO_H_

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "dcloth/dcloth_fit.h"
#include "tools/character/character_space.h"
#include "tools/character/joint_map.h"

namespace dcloth::tools {

// Metres, +Y up. Joints are the skin's bones and what a map names; without a skin all nodes.
struct Hero {
  std::vector<std::string> joints;
  std::vector<size_t> nodes;    // of the file, [joints]
  std::vector<uint32_t> roles;  // DCLOTH_ROLE_*, of a map or of VRM's own list; NONE: by name
  std::vector<float> bind;      // [joints, 16] rows contiguous
  CharacterSpace space;
  Eigen::Matrix4d from_bind = Eigen::Matrix4d::Identity();  // from the space of the skin's bind pose to the nodes'
  std::vector<Eigen::Matrix4d> rest;                        // all nodes in the bind pose, [nodes of the file]
  // The skin of all meshes; four joints a vertex, those with the largest weights, rows of sum 1.
  std::vector<float> positions;            // [b, 3] world, bind pose
  std::vector<uint32_t> influences;        // [b, 4]
  std::vector<float> weights;              // [b, 4]
  std::vector<uint32_t> triangles;         // [c, 3]
  std::vector<uint32_t> materials;         // [c] of the file's
  std::vector<float> texture_coordinates;  // [c, 3, 2], 0 where a mesh has none
  std::vector<uint8_t> colours;            // [c, 3, 3] sRGB, white where a mesh has none; empty where all have none
};

// The role of each node, [nodes]: told by the file (VRM), or by its name without what nearly all joints' names have in
// common (a prefix, numbers).
std::vector<uint32_t> NodeRoles(const CharacterFile& file);

// Keys of `map` are joints of the garment or names of roles ("Hips", "left upper leg"). Throws converter::Error.
Hero ReadHero(const CharacterFile& file, const JointMap& map, const SpaceOptions& options);

// The parts of dcloth_character, which lead into the hero and into `names`.
dcloth_character CharacterOf(const Hero& hero, std::vector<const char*>* names);

// Poses on demand, one frame at a time: a clip of an hour takes no more memory than its file.
struct HeroClip {
  std::string name;
  double fps = 0;
  size_t frames = 0;
  // [joints, 16] of a frame: joint to world, rows contiguous, metres. Throws converter::Error.
  std::function<std::vector<float>(size_t frame)> pose;
};

// The hero's file and the hero outlive the clips below. Clips of another file take the turns of joints from joint to
// joint and the way of the hips, times the ratio of their heights; lengths stay the hero's.

// The first clip of the hero's file, which has one.
HeroClip FirstClip(const CharacterFile& file, const Hero& hero, double fps);

// `animation` is a clip of the hero's file by name or number, or a file with a skeleton of the same names or roles:
// "walk.fbx", "clips.glb#Run". Throws converter::Error, also where the two have no joints in common.
HeroClip ReadAnimation(const std::string& animation, const CharacterFile& file, const Hero& hero, double fps);

// One pose of `frames` frames: the bind pose.
HeroClip StandStill(const Hero& hero, double fps, size_t frames);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_HERO_H_
