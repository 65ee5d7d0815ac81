// Joint matrices as files of training hold them, and refusals of what a character's file holds.
#ifndef DCLOTH_TOOLS_CHARACTER_MATRIX_VALUES_H_
#define DCLOTH_TOOLS_CHARACTER_MATRIX_VALUES_H_

#include <string>
#include <vector>

#include "tools/character/character.h"

namespace dcloth::tools {

// Sixteen floats more, row by row; false where one leaves the range of float.
[[nodiscard]] bool AppendMatrix(const Eigen::Matrix4d& matrix, std::vector<float>* values);

// Each throws converter::Error. `where` as in "joint 'Hips' at rest".
[[noreturn]] void RefuseNumbers(const CharacterFile& file, const std::string& where);
[[noreturn]] void Refuse(const CharacterFile& file, const std::string& found, const std::string& expected,
                         const std::string& mend = {});
void CheckNumber(const CharacterFile& file, double value, const std::string& where);  // finite and within 1e9

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_MATRIX_VALUES_H_
