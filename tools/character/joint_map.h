// Which node of a file is which joint of a garment.
#ifndef DCLOTH_TOOLS_CHARACTER_JOINT_MAP_H_
#define DCLOTH_TOOLS_CHARACTER_JOINT_MAP_H_

#include <map>
#include <span>
#include <string>
#include <vector>

#include "tools/character/character.h"

namespace dcloth::tools {

using JointMap = std::map<std::string, std::string>;  // joint of the garment -> node of the file

// A JSON object of texts, at most 1 MB. Throws converter::Error.
JointMap ReadJointMap(const std::filesystem::path& path);

// Joints of a file in its own words: the bones of the skin, without a skin the animated nodes; with the map's joints in
// place of the nodes they stand for. Throws converter::Error where the map calls a node like another joint.
std::vector<std::string> JointsOf(const CharacterFile& file, const JointMap& map);

// For each joint its node: the map's, otherwise the node of the same name. Throws converter::Error with every joint
// that has none and the names of the file that come closest, and where a name stands for two nodes.
std::vector<size_t> FindJoints(const CharacterFile& file, const JointMap& map, std::span<const std::string> joints);

// Names of `held` closest to `name`, best first: equal but for case, namespace and punctuation, then by edit distance.
std::vector<std::string> NearestNames(const std::string& name, std::span<const std::string> held, size_t count);

// Names of all nodes without what nearly all of the joints' have in common: a prefix, as "Hero_", or numbers, as "_07".
std::vector<std::string> OwnNames(const CharacterFile& file);

std::string JsonList(std::span<const std::string> names);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_JOINT_MAP_H_
