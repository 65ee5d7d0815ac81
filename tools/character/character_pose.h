// Where a character's nodes are at a time of a clip.
#ifndef DCLOTH_TOOLS_CHARACTER_CHARACTER_POSE_H_
#define DCLOTH_TOOLS_CHARACTER_CHARACTER_POSE_H_

#include <vector>

#include "tools/character/character.h"

namespace dcloth::tools {

// Every node to the file's world, [nodes]; `clip` may be null: the pose without animation. Beyond the first and last
// key curves hold.
std::vector<Eigen::Matrix4d> WorldMatrices(const CharacterFile& file, const CharacterClip* clip, double seconds);

// The pose the skin was bound in where there is a skin, otherwise the pose without animation; [nodes], file's world.
std::vector<Eigen::Matrix4d> RestMatrices(const CharacterFile& file);

// first_seconds and last_seconds from the clip's keys; 0 where there are none.
void SetSpan(CharacterClip* clip);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_CHARACTER_POSE_H_
