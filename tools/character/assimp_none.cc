// In place of assimp_reader.cc where assimp was not found.
#include "converter/error.h"
#include "tools/character/read_by_assimp.h"

namespace dcloth::tools {

CharacterFile ReadByAssimp(const std::filesystem::path& path, const std::string& format, bool) {
  throw converter::Error({.path = path,
                          .tensor = {},
                          .found = "a dcloth built without assimp",
                          .expected = "a dcloth built with assimp, which reads " + format,
                          .mend = "export it as glTF (.glb), or install the development files of assimp (Debian: "
                                  "libassimp-dev) and build again"});
}

}  // namespace dcloth::tools
