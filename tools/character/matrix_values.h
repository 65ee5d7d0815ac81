// Joint matrices as files of training hold them.
#ifndef DCLOTH_TOOLS_CHARACTER_MATRIX_VALUES_H_
#define DCLOTH_TOOLS_CHARACTER_MATRIX_VALUES_H_

#include <string>
#include <vector>

#include "tools/character/character.h"

namespace dcloth::tools {

// Sixteen floats more, row by row; false where one leaves the range of float.
[[nodiscard]] bool AppendMatrix(const Eigen::Matrix4d& matrix, std::vector<float>* values);

// Throws converter::Error; `where` as in "joint 'Hips' at rest".
[[noreturn]] void RefuseNumbers(const CharacterFile& file, const std::string& where);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_MATRIX_VALUES_H_
