// Wavefront OBJ: the mesh that a point cache moves.
#ifndef DCLOTH_TOOLS_OBJ_H_
#define DCLOTH_TOOLS_OBJ_H_

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

namespace dcloth::tools {

// positions [n, 3], triangles [c, 3]; vertices in order, every float to the bit. Writes atomically; throws
// converter::Error.
void WriteObj(const std::filesystem::path& path, const std::string& name, std::span<const float> positions,
              std::span<const uint16_t> triangles);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_OBJ_H_
