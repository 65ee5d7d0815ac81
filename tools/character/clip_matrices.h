// A clip of a file as a sequence holds it: every joint's matrix at a steady rate.
#ifndef DCLOTH_TOOLS_CHARACTER_CLIP_MATRICES_H_
#define DCLOTH_TOOLS_CHARACTER_CLIP_MATRICES_H_

#include <vector>

#include "tools/character/retarget.h"
#include "tools/character/skeleton.h"

namespace dcloth::tools {

struct ClipMatrices {
  size_t frame_count = 0;
  std::vector<float> values;  // [frames, joints, 4, 4], metres, +Y up; finite
};

// Frames from the first key to the last, `fps` a second. Throws converter::Error above 4 GB and where numbers leave the
// range of float.
ClipMatrices SampleClip(const CharacterFile& file, const CharacterClip& clip, const Skeleton& skeleton,
                        const Retarget& retarget, double fps);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_CLIP_MATRICES_H_
