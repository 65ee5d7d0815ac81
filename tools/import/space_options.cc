#include "tools/import/space_options.h"

namespace dcloth::tools {

void AddSpaceOptions(CLI::App* command, SpaceOptions* options) {
  command->add_option(
      "--unit", options->unit,
      "the file's unit: m, cm, mm, in, ft or metres in a unit; as the file says when not given, metres\n"
      "where it does not (BVH)");
  command
      ->add_option(
          "--up", options->up,
          "the file's up axis; as the file says when not given, y where it does not (BVH). z: Blender's axes,\n"
          "the character faces -Y")
      ->check(CLI::IsMember({"y", "z"}));
}

}  // namespace dcloth::tools
