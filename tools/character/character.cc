#include "tools/character/character.h"

#include <new>

#include "converter/error.h"
#include "converter/file.h"
#include "tools/character/gltf_model.h"
#include "tools/character/gltf_reader.h"
#include "tools/character/memory_limit.h"
#include "tools/character/read_by_assimp.h"

namespace dcloth::tools {
namespace {

CharacterFile ReadGltf(const std::filesystem::path& path, bool meshes) {
  const converter::AlignedBytes bytes = converter::ReadFile(path, uint64_t{1} << 30);
  MemoryLimit limit;
  limit.Allow(bytes.size());
  Folder folder(path.parent_path(), &limit);
  try {
    const tinygltf::Model model = ReadGltfModel(path, bytes, &folder);
    return GltfReader(path, model, &folder).Read(meshes);
  } catch (const std::bad_alloc&) {
  }
  limit.Lift();
  throw converter::Error(
      {.path = path,
       .tensor = {},
       .found = "a file that takes more memory to read than " + std::to_string(limit.allowance() >> 20) + " MiB",
       .expected = "a glTF file of ordinary proportions",
       .mend = "export it again"});
}

}  // namespace

CharacterFile ReadCharacter(const std::filesystem::path& path, bool meshes) {
  std::string extension = path.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  for (const char* const gltf : {".glb", ".gltf", ".vrm", ".vrma"}) {
    if (extension == gltf) return ReadGltf(path, meshes);
  }
  if (extension == ".fbx") return ReadByAssimp(path, "FBX", meshes);
  if (extension == ".bvh") return ReadByAssimp(path, "BVH", meshes);
  throw converter::Error({.path = path,
                          .tensor = {},
                          .found = "a file name that ends in '" + extension + "'",
                          .expected = ".glb, .gltf, .vrm, .fbx or .bvh",
                          .mend = "export the character as glTF, FBX or BVH"});
}

}  // namespace dcloth::tools
