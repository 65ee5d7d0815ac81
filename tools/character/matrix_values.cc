#include "tools/character/matrix_values.h"

#include <cmath>

#include "converter/error.h"

namespace dcloth::tools {

bool AppendMatrix(const Eigen::Matrix4d& matrix, std::vector<float>* values) {
  const Eigen::Matrix<float, 4, 4, Eigen::RowMajor> rows = matrix.cast<float>();
  values->insert(values->end(), rows.data(), rows.data() + rows.size());
  return rows.allFinite();
}

void Refuse(const CharacterFile& file, const std::string& found, const std::string& expected, const std::string& mend) {
  throw converter::Error({.path = file.path, .tensor = {}, .found = found, .expected = expected, .mend = mend});
}

void RefuseNumbers(const CharacterFile& file, const std::string& where) {
  Refuse(file, "a number that is out of range at " + where, "finite numbers", "the file is damaged; export it again");
}

void CheckNumber(const CharacterFile& file, double value, const std::string& where) {
  constexpr double kMost = 1e9;
  if (std::isfinite(value) && std::abs(value) <= kMost) return;
  Refuse(file, "the number " + std::to_string(value) + " in " + where, "numbers within 1e9", "the file is damaged");
}

}  // namespace dcloth::tools
