// Point cache 2: vertex animation that Blender's Mesh Cache modifier, Houdini and others read.
#ifndef DCLOTH_TOOLS_PC2_H_
#define DCLOTH_TOOLS_PC2_H_

#include <cstddef>
#include <filesystem>
#include <span>

namespace dcloth::tools {

// positions [frame_count, vertex_count, 3]. Samples are one frame apart, starting at frame 0: set the scene to the rate
// the frames were made at. Writes atomically; throws converter::Error.
void WritePc2(const std::filesystem::path& path, std::span<const float> positions, size_t frame_count,
              size_t vertex_count);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PC2_H_
