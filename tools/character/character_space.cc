#include "tools/character/character_space.h"

#include <array>
#include <cstdio>
#include <utility>

#include "converter/error.h"

namespace dcloth::tools {
namespace {

constexpr double kSmallest = 0.1, kLargest = 10;  // metres that a skeleton spans

constexpr std::array<std::pair<const char*, double>, 5> kUnits = {
    {{"m", 1.0}, {"cm", 0.01}, {"mm", 0.001}, {"in", 0.0254}, {"ft", 0.3048}}};

double ParseUnit(const std::string& text) {
  for (const auto& [name, metres] : kUnits) {
    if (text == name) return metres;
  }
  try {
    size_t used = 0;
    const double metres = std::stod(text, &used);
    if (used == text.size() && metres >= 1e-6 && metres <= 1e6) return metres;
  } catch (const std::logic_error&) {
  }
  throw converter::Error({.path = {},
                          .tensor = {},
                          .found = "unit '" + text + "'",
                          .expected = "m, cm, mm, in, ft, or metres per unit from 1e-6 to 1e6",
                          .mend = {}});
}

}  // namespace

Eigen::Matrix4d CharacterSpace::World(const Eigen::Matrix4d& matrix) const {
  Eigen::Matrix4d out = matrix;
  out.topLeftCorner<3, 3>() = upright * matrix.topLeftCorner<3, 3>();
  out.topRightCorner<3, 1>() = Point(matrix.topRightCorner<3, 1>());
  return out;
}

CharacterSpace SpaceOf(const CharacterFile& file, const SpaceOptions& options,
                       std::span<const Eigen::Matrix4d> rest_joints) {
  CharacterSpace space;
  space.upright = file.upright;
  if (options.up == "y") space.upright.setIdentity();
  if (options.up == "z") space.upright << 1, 0, 0, 0, 0, 1, 0, -1, 0;
  if (!options.unit.empty()) {
    space.metres_per_unit = ParseUnit(options.unit);
    return space;
  }
  space.metres_per_unit = file.metres_per_unit.value_or(1.0);
  Eigen::AlignedBox3d box;
  for (const Eigen::Matrix4d& joint : rest_joints) box.extend(Eigen::Vector3d(joint.topRightCorner<3, 1>()));
  const double span = rest_joints.empty() ? 0 : space.metres_per_unit * box.sizes().maxCoeff();
  if (rest_joints.size() > 1 && (span < kSmallest || span > kLargest)) {
    char found[160];
    std::snprintf(found, sizeof found, "joints that span %.4g m at rest, at %g m per unit (%s)", span,
                  space.metres_per_unit, file.metres_per_unit ? "the file says so" : "the file does not say");
    throw converter::Error({.path = file.path,
                            .tensor = {},
                            .found = found,
                            .expected = "0.1 to 10 m",
                            .mend = "give the file's unit, such as --unit cm"});
  }
  return space;
}

}  // namespace dcloth::tools
