// The skinned body of a character in its bind pose, as training reads it.
#ifndef DCLOTH_TOOLS_CHARACTER_SKINNED_BODY_H_
#define DCLOTH_TOOLS_CHARACTER_SKINNED_BODY_H_

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/character/skeleton.h"

namespace dcloth::tools {

struct SkinnedBody {
  std::vector<float> bind;                // [joints, 4, 4], world, metres; axes of length 1
  std::vector<int32_t> parents;           // [joints], the next joint above; -1 where there is none
  std::vector<float> positions, weights;  // [b, 3], metres; [b, joints], rows of sum 1
  std::vector<int32_t> faces;             // [c, 3]
};

// Of the meshes named, of all where none is. Throws converter::Error where one is missing, a vertex has no weight or
// none of a joint, and where numbers leave the range of float.
SkinnedBody SkinnedBodyOf(const CharacterFile& file, std::span<const std::string> meshes, const Skeleton& skeleton);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_SKINNED_BODY_H_
