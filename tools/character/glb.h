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

// A binary glTF whose accessors all have bytes. One without a view of a buffer is all zeros, which exporters use and
// assimp does not read; here they share zeros at the end of the file's buffer. Empty where there is nothing to add, or
// where the zeros would be longer than kMostZeros.
constexpr uint64_t kMostZeros = uint64_t{16} << 20;
std::vector<std::byte> WithZeros(std::span<const std::byte> bytes);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_GLB_H_
