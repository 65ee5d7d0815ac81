// Bytes as a scene that a reader of artists' files could hand over, and what a user asks of it.
#ifndef DCLOTH_TESTS_FUZZ_SCENE_BYTES_H_
#define DCLOTH_TESTS_FUZZ_SCENE_BYTES_H_

#include <assimp/scene.h>

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>

#include "tests/fuzz/character_use.h"

namespace dcloth::testing {

struct SceneRequest {
  std::string format;  // "FBX" or "BVH"
  std::unique_ptr<aiScene> scene;
  CharacterRequest user;
};

// Every byte string is one; where it ends, zeros follow. Sizes, indices within arrays and pointers are sound, as a
// reader's are that did not crash; names, references by name, numbers and the indices that a file holds need not be.
SceneRequest DecodeScene(const uint8_t* bytes, size_t size);

}  // namespace dcloth::testing

#endif  // DCLOTH_TESTS_FUZZ_SCENE_BYTES_H_
