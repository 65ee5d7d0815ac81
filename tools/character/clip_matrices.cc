#include "tools/character/clip_matrices.h"

#include <cmath>
#include <cstdint>
#include <cstdio>

#include "converter/error.h"
#include "tools/character/character_pose.h"
#include "tools/character/matrix_values.h"

namespace dcloth::tools {
namespace {

constexpr uint64_t kMaxBytes = uint64_t{4} << 30;

}  // namespace

ClipMatrices SampleClip(const CharacterFile& file, const CharacterClip& clip, const Skeleton& skeleton,
                        const Retarget& retarget, double fps) {
  const size_t joint_count = skeleton.nodes.size();
  const double seconds = clip.last_seconds - clip.first_seconds;
  const double frames = std::floor(seconds * fps + 1e-3) + 1;
  if (frames * static_cast<double>(joint_count) * 64 > static_cast<double>(kMaxBytes)) {
    char found[64];
    std::snprintf(found, sizeof found, "%.9g s at %.9g Hz", seconds, fps);
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = found,
                            .expected = "a sequence of at most 4 GB",
                            .mend = "shorten the clip or lower --fps"});
  }
  ClipMatrices out;
  out.frame_count = static_cast<size_t>(frames);
  out.values.reserve(out.frame_count * joint_count * 16);
  for (size_t f = 0; f < out.frame_count; ++f) {
    const auto world = WorldMatrices(file, &clip, clip.first_seconds + static_cast<double>(f) / fps);
    for (size_t j = 0; j < joint_count; ++j) {
      const Eigen::Matrix4d joint = retarget.Joint(j, skeleton.space.World(world[skeleton.nodes[j]]));
      if (!AppendMatrix(joint, &out.values)) {
        RefuseNumbers(file, "joint '" + skeleton.joints[j] + "', frame " + std::to_string(f));
      }
    }
  }
  return out;
}

}  // namespace dcloth::tools
