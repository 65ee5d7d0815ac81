// In place of assimp_reader.cc where assimp was not found.
#include "converter/error.h"
#include "tools/character/character.h"

namespace dcloth::tools {

CharacterFile ReadCharacter(const std::filesystem::path& path, bool) {
  throw converter::Error({.path = path,
                          .tensor = {},
                          .found = "a dcloth built without assimp",
                          .expected = "a dcloth built with assimp, which reads glTF, FBX and BVH",
                          .mend = "install the development files of assimp (Debian: libassimp-dev) and build again"});
}

}  // namespace dcloth::tools
