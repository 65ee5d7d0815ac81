// The joints that a garment or training wants, found in a file and brought to metres, +Y up.
#ifndef DCLOTH_TOOLS_CHARACTER_SKELETON_H_
#define DCLOTH_TOOLS_CHARACTER_SKELETON_H_

#include <span>
#include <string>
#include <vector>

#include "tools/character/character_space.h"
#include "tools/character/joint_map.h"

namespace dcloth::tools {

struct Skeleton {
  std::vector<std::string> joints;
  std::vector<size_t> nodes;  // of the file, [joints]
  CharacterSpace space;
  std::vector<Eigen::Matrix4d> rest;  // RestMatrices in `space`, [joints]
};

// `wanted`: joints by name; empty: every joint of the file. Throws converter::Error where one is missing, where the
// file has none, and as SpaceOf does.
Skeleton SkeletonOf(const CharacterFile& file, const JointMap& map, std::span<const std::string> wanted,
                    const SpaceOptions& options);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_SKELETON_H_
