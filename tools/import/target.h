// The joints that an animation is brought to: a garment's or a character's.
#ifndef DCLOTH_TOOLS_IMPORT_TARGET_H_
#define DCLOTH_TOOLS_IMPORT_TARGET_H_

#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

namespace dcloth::tools {

struct Target {
  std::vector<std::string> joint_names;
  std::vector<Eigen::Matrix4d> bind;  // world, metres; empty where the file does not say (a model)
  double tick_rate = 0;               // Hz; 0 where the file does not say (a character)
};

// From a model (.dcloth), a bundle, or a character that training reads (.safetensors). Throws converter::Error.
Target ReadTarget(const std::filesystem::path& path);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_IMPORT_TARGET_H_
