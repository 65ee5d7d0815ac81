// Meshes and their motion as other programs read them.
#ifndef DCLOTH_TOOLS_MESH_FILES_H_
#define DCLOTH_TOOLS_MESH_FILES_H_

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace dcloth::tools {

// Wavefront OBJ, the mesh that a point cache moves: the file's text. positions [n, 3], triangles [c, 3]; vertices
// in order, every float to the bit.
std::string ObjText(const std::string& name, std::span<const float> positions, std::span<const uint16_t> triangles);

// MDD, with a clock in seconds: Blender's Mesh Cache modifier, Houdini, Maya and others read it. positions
// [frame_count, vertex_count, 3]; frame f at f / fps seconds. Writes atomically; throws converter::Error.
void WriteMdd(const std::filesystem::path& path, std::span<const float> positions, size_t frame_count,
              size_t vertex_count, double fps);

// Point cache 2: Blender's Mesh Cache modifier, Houdini and others read it. positions [frame_count, vertex_count, 3].
// Samples are one frame apart, starting at frame 0: set the scene to the rate the frames were made at. Writes
// atomically; throws converter::Error.
void WritePc2(const std::filesystem::path& path, std::span<const float> positions, size_t frame_count,
              size_t vertex_count);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_MESH_FILES_H_
