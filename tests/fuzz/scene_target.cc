#include "tests/fuzz/character_use.h"
#include "tests/fuzz/scene_bytes.h"
#include "tools/character/assimp_reader.h"

namespace dcloth::testing {
namespace {

// Pictures of a scene are its own or none.
class NoFiles : public Assimp::IOSystem {
 public:
  bool Exists(const char*) const override { return false; }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char*, const char*) override { return nullptr; }
  void Close(Assimp::IOStream*) override {}
};

}  // namespace

Verdict FuzzScene(const uint8_t* bytes, size_t size) {
  const SceneRequest asked = DecodeScene(bytes, size);
  return ReadAndUse([&] { return tools::AssimpReader(*asked.scene, NoFiles(), asked.format, "scene").Read(true); },
                    asked.user);
}

}  // namespace dcloth::testing
