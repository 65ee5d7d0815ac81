#include "tools/import/space_options.h"

namespace dcloth::tools {

void AddSpaceOptions(CLI::App* command, SpaceOptions* options) {
  command->add_option(
      "--unit", options->unit,
      "the file's unit: m, cm, mm, in, ft, or metres per unit. Default: what the file says; metres if it says\n"
      "nothing (BVH)");
  command
      ->add_option(
          "--up", options->up,
          "the file's up axis. Default: what the file says; y if it says nothing (BVH). z means Blender's axes: the\n"
          "character faces -Y")
      ->transform(CLI::IsMember({"y", "z"}, CLI::ignore_case));
}

}  // namespace dcloth::tools
