#include "tools/character/matrix_values.h"

#include "converter/error.h"

namespace dcloth::tools {

bool AppendMatrix(const Eigen::Matrix4d& matrix, std::vector<float>* values) {
  const Eigen::Matrix<float, 4, 4, Eigen::RowMajor> rows = matrix.cast<float>();
  values->insert(values->end(), rows.data(), rows.data() + rows.size());
  return rows.allFinite();
}

void RefuseNumbers(const CharacterFile& file, const std::string& where) {
  throw converter::Error({.path = file.path,
                          .tensor = {},
                          .found = "a number that is out of range at " + where,
                          .expected = "finite numbers",
                          .mend = "the file is damaged; export it again"});
}

}  // namespace dcloth::tools
