// A glTF file, plain or binary, in tinygltf's words: what its JSON says, and the bytes of its buffers.
#ifndef DCLOTH_TOOLS_CHARACTER_GLTF_MODEL_H_
#define DCLOTH_TOOLS_CHARACTER_GLTF_MODEL_H_

#include <tiny_gltf.h>

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "tools/character/folder.h"

namespace dcloth::tools {

// Buffers come out of `folder`. Pictures are left unread: those written into the JSON are kept as they are. Throws
// converter::Error where a length of the container is more than the file holds, where its text is no JSON or nests
// deeper than 64, where tinygltf takes it for no glTF, and where meshes are compressed.
tinygltf::Model ReadGltfModel(const std::filesystem::path& path, std::span<const std::byte> bytes, Folder* folder);

// A file name as a URI writes it: %20 is a space.
std::filesystem::path UriPath(const std::string& uri);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_GLTF_MODEL_H_
