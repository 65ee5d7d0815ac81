#include "tools/import/target.h"

#include <Eigen/LU>
#include <cmath>

#include "converter/bundle_metadata.h"
#include "converter/error.h"
#include "converter/safetensors.h"
#include "tools/playback.h"

namespace dcloth::tools {

Target ReadTarget(const std::filesystem::path& path) {
  Target target;
  if (path.extension() == ".dcloth") {
    const converter::OpenModel model = OpenModelFile(path);
    target.joint_names = model.joint_names();
    target.tick_rate = TickRate(model);
    return target;
  }
  const converter::SafeFile file = converter::SafeFile::Read(path);
  target.joint_names = converter::UniqueNames(file, "joint_names");
  if (file.metadata().contains("tick_rate")) target.tick_rate = converter::PositiveNumber(file, "tick_rate", 1000);
  const bool bundle = file.Find("character.bind") != nullptr;
  const converter::SafeTensor& bind = file.Require(bundle ? "character.bind" : "joint_bind");
  if (bind.shape != converter::Shape{target.joint_names.size(), 4, 4}) {
    throw converter::Error({.path = path,
                            .tensor = bind.name,
                            .found = "shape " + converter::ShapeText(bind.shape),
                            .expected = "[" + std::to_string(target.joint_names.size()) + ", 4, 4]",
                            .mend = {}});
  }
  const std::vector<float> values = converter::FloatsOf(file, bind);
  using RowMajor = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  for (size_t j = 0; j < target.joint_names.size(); ++j) {
    target.bind.emplace_back(Eigen::Map<const RowMajor>(values.data() + 16 * j).cast<double>());
    if (std::abs(target.bind.back().topLeftCorner<3, 3>().determinant()) < 1e-9) {
      throw converter::Error({.path = path,
                              .tensor = bind.name,
                              .found = "a matrix without volume for joint '" + target.joint_names[j] + "'",
                              .expected = "invertible bind matrices",
                              .mend = {}});
    }
  }
  return target;
}

}  // namespace dcloth::tools
