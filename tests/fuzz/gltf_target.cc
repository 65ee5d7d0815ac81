#include <span>

#include "tests/fuzz/character_use.h"
#include "tools/character/gltf_model.h"
#include "tools/character/gltf_reader.h"

namespace dcloth::testing {

Verdict FuzzGltf(const uint8_t* bytes, size_t size) {
  const std::filesystem::path path = "nowhere/file.glb";
  tools::Folder folder(path.parent_path(), nullptr);  // is not there, so nothing in it is read
  return ReadAndUse(
      [&] {
        const tinygltf::Model model = tools::ReadGltfModel(path, std::as_bytes(std::span(bytes, size)), &folder);
        return tools::GltfReader(path, model, &folder).Read(true);
      },
      {});
}

}  // namespace dcloth::testing
