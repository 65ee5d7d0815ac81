#include "tools/character/skeleton.h"

#include "converter/error.h"
#include "tools/character/character_pose.h"
#include "tools/character/matrix_values.h"

namespace dcloth::tools {

Skeleton SkeletonOf(const CharacterFile& file, const JointMap& map, std::span<const std::string> wanted,
                    const SpaceOptions& options) {
  Skeleton skeleton;
  skeleton.joints.assign(wanted.begin(), wanted.end());
  if (wanted.empty()) skeleton.joints = JointsOf(file, map);
  skeleton.nodes = FindJoints(file, map, skeleton.joints);
  if (skeleton.nodes.empty()) {
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = "neither bones nor animated nodes",
                            .expected = "a skeleton",
                            .mend = "export the character with its armature"});
  }
  const std::vector<Eigen::Matrix4d> all = RestMatrices(file);
  for (size_t j = 0; j < skeleton.nodes.size(); ++j) {
    skeleton.rest.push_back(all[skeleton.nodes[j]]);
    if (!skeleton.rest.back().allFinite()) RefuseNumbers(file, "joint '" + skeleton.joints[j] + "' at rest");
  }
  skeleton.space = SpaceOf(file, options, skeleton.rest);
  for (Eigen::Matrix4d& joint : skeleton.rest) joint = skeleton.space.World(joint);
  return skeleton;
}

}  // namespace dcloth::tools
