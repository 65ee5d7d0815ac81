// Binary glTF: whether the container's lengths can be true. Readers allocate what a length claims before they read it.
#ifndef DCLOTH_TOOLS_CHARACTER_GLB_H_
#define DCLOTH_TOOLS_CHARACTER_GLB_H_

#include <cstddef>
#include <filesystem>
#include <span>

namespace dcloth::tools {

// Throws converter::Error where `bytes` begin like a binary glTF file and a length in them is more than the file holds.
// Looks at nothing else; other files pass.
void CheckGlbLengths(const std::filesystem::path& path, std::span<const std::byte> bytes);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_GLB_H_
