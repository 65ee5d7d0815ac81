// Binary glTF: whether the container's lengths can be true. Readers allocate what a length claims before they read it.
#ifndef DCLOTH_TOOLS_CHARACTER_GLB_H_
#define DCLOTH_TOOLS_CHARACTER_GLB_H_

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace dcloth::tools {

// Throws converter::Error where `bytes` begin like a binary glTF file and a length in them is more than the file holds.
// Looks at nothing else; other files pass.
void CheckGlbLengths(const std::filesystem::path& path, std::span<const std::byte> bytes);

// What binary or plain glTF says beyond what assimp hands on. Empty for what is no glTF or no JSON: assimp tells more
// of it.
struct GltfFacts {
  std::vector<std::pair<std::string, uint32_t>> roles;  // node's name, DCLOTH_ROLE_*: VRM 0 and 1
  std::vector<std::string> required;                    // extensions without which the file cannot be read
};
GltfFacts ReadGltfFacts(std::span<const std::byte> bytes);

// A binary glTF with what assimp does not know said in its words, or nothing where there is no such thing. An accessor
// without a view of a buffer is all zeros: it gets zeros at the end of the file's buffer, unless they were longer than
// kMostZeros. Textures that are WebP pictures get them in the place of other pictures.
constexpr uint64_t kMostZeros = uint64_t{16} << 20;
std::vector<std::byte> ForAssimp(std::span<const std::byte> bytes);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_GLB_H_
