// FBX and BVH, which assimp reads where it was found at build time.
#ifndef DCLOTH_TOOLS_CHARACTER_READ_BY_ASSIMP_H_
#define DCLOTH_TOOLS_CHARACTER_READ_BY_ASSIMP_H_

#include <string>

#include "tools/character/character.h"

namespace dcloth::tools {

// As ReadCharacter; `format` is "FBX" or "BVH". Throws converter::Error; always in a build without assimp.
CharacterFile ReadByAssimp(const std::filesystem::path& path, const std::string& format, bool meshes);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_READ_BY_ASSIMP_H_
