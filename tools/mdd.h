// MDD: vertex animation with a clock in seconds; Blender's Mesh Cache modifier, Houdini, Maya and others read it.
#ifndef DCLOTH_TOOLS_MDD_H_
#define DCLOTH_TOOLS_MDD_H_

#include <cstddef>
#include <filesystem>
#include <span>

namespace dcloth::tools {

// positions [frame_count, vertex_count, 3]; frame f at f / fps seconds. Writes atomically; throws converter::Error.
void WriteMdd(const std::filesystem::path& path, std::span<const float> positions, size_t frame_count,
              size_t vertex_count, double fps);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_MDD_H_
