// Wavefront OBJ: the mesh that a point cache moves.
#ifndef DCLOTH_TOOLS_OBJ_H_
#define DCLOTH_TOOLS_OBJ_H_

#include <cstdint>
#include <span>
#include <string>

namespace dcloth::tools {

// The file's text. positions [n, 3], triangles [c, 3]; vertices in order, every float to the bit.
std::string ObjText(const std::string& name, std::span<const float> positions, std::span<const uint16_t> triangles);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_OBJ_H_
