// Values of glTF's accessors: any component type, strides, sparse ones, each byte checked to be there.
#ifndef DCLOTH_TOOLS_CHARACTER_GLTF_ACCESSOR_H_
#define DCLOTH_TOOLS_CHARACTER_GLTF_ACCESSOR_H_

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "tools/character/character.h"

namespace dcloth::tools {

class GltfAccessors {
 public:
  // Both outlive it. Errors are converter::Error and name the file.
  GltfAccessors(const CharacterFile& file, const tinygltf::Model& model) : file_(file), model_(model) {}

  // [count, width] of an accessor of that width; `where` names what wants it. Normalized integers become -1 to 1.
  std::vector<float> Floats(int accessor, int width, const std::string& where) const;
  std::vector<uint32_t> Indices(int accessor, int width, const std::string& where) const;  // of unsigned integers

  int Width(int accessor, const std::string& where) const;
  std::span<const std::byte> View(int view, const std::string& where) const;

 private:
  const tinygltf::Accessor& Find(int accessor, const std::string& where) const;
  template <typename Value, typename Convert>
  std::vector<Value> Read(int accessor, int width, const std::string& where, const Convert& convert) const;

  const CharacterFile& file_;
  const tinygltf::Model& model_;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_GLTF_ACCESSOR_H_
