#include "tools/import/target.h"

#include <Eigen/LU>
#include <cmath>

#include "converter/assemble.h"
#include "converter/bundle.h"
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
    for (uint32_t j = 0; j < model.info().joint_count; ++j) {
      Eigen::Matrix<float, 4, 4, Eigen::RowMajor> bind;
      if (dcloth_model_joint_bind(model.model(), j, bind.data()) != DCLOTH_OK) {
        throw converter::Error({.path = path,
                                .tensor = {},
                                .found = "a bind matrix that has no inverse for joint '" + target.joint_names[j] + "'",
                                .expected = "invertible bind matrices",
                                .mend = "convert the bundle again"});
      }
      target.bind.emplace_back(bind.cast<double>());
    }
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
                            .mend = "export the file again"});
  }
  const std::vector<float> values = converter::FloatsOf(file, bind);
  using RowMajor = Eigen::Matrix<float, 4, 4, Eigen::RowMajor>;
  for (size_t j = 0; j < target.joint_names.size(); ++j) {
    target.bind.emplace_back(Eigen::Map<const RowMajor>(values.data() + 16 * j).cast<double>());
    if (std::abs(target.bind.back().topLeftCorner<3, 3>().determinant()) < 1e-9) {
      throw converter::Error({.path = path,
                              .tensor = bind.name,
                              .found = "a matrix that has no inverse for joint '" + target.joint_names[j] + "'",
                              .expected = "invertible bind matrices",
                              .mend = "export the file again"});
    }
  }
  if (!bundle) return target;
  // Of a bundle only the joints that its models read.
  Target read;
  read.tick_rate = target.tick_rate;
  for (const uint32_t joint : converter::FoldBundle(converter::ReadBundle(path), 8, 8).joints.joints) {
    read.joint_names.push_back(target.joint_names[joint]);
    read.bind.push_back(target.bind[joint]);
  }
  return read;
}

}  // namespace dcloth::tools
