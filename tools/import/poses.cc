// `dcloth poses`: an animation of glTF, FBX or BVH as a sequence.
#include <Eigen/LU>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>

#include "converter/assemble.h"
#include "converter/bundle.h"
#include "converter/bundle_metadata.h"
#include "converter/error.h"
#include "converter/safetensors.h"
#include "tools/character/skeleton.h"
#include "tools/commands.h"
#include "tools/import/import.h"
#include "tools/playback.h"
#include "tools/progress.h"

namespace dcloth::tools {
namespace {

constexpr double kDefaultRate = 30;   // what training simulates at
constexpr double kWorthAWord = 0.02;  // metres between two skeletons at rest

struct Options {
  std::filesystem::path animation, output, map, model;
  std::string clip;
  double fps = 0;  // 0: the model's tick rate
  SpaceOptions space;
};

// The joints that an animation is brought to: a garment's or a character's.
struct Target {
  std::vector<std::string> joint_names;
  std::vector<Eigen::Matrix4d> bind;  // world, metres; empty where the file does not say (a model)
  double tick_rate = 0;               // Hz; 0 where the file does not say (a character)
};

// From a model (.dcloth), a bundle, or a character that training reads (.safetensors). Throws converter::Error.
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

const CharacterClip& ChooseClip(const CharacterFile& file, const std::string& wanted) {
  std::string held;
  for (size_t i = 0; i < file.clips.size(); ++i) {
    if (!wanted.empty() && (file.clips[i].name == wanted || std::to_string(i) == wanted)) return file.clips[i];
    held += (i == 0 ? "'" : ", '") + file.clips[i].name + "'";
  }
  if (wanted.empty() && file.clips.size() == 1) return file.clips.front();
  throw converter::Error({.path = file.path,
                          .tensor = {},
                          .found = file.clips.empty() ? "no animation" : "the clips " + held,
                          .expected = wanted.empty() ? "one clip" : "a clip '" + wanted + "'",
                          .mend = file.clips.empty() ? "export the character with its animation baked to keys"
                                                     : "choose one with --clip NAME, or by its number from 0"});
}

std::string NumberText(double value) {
  char text[32];
  char* const end = std::to_chars(text, text + sizeof(text), value).ptr;
  return {text, end};
}

int Poses(const Options& options) {
  CommandFiles files;
  files.Reads("the animation", options.animation);
  files.Reads("the file of --map", options.map);
  files.Reads("the file of --model", options.model);
  files.Writes("-o", options.output);
  files.Check();
  if (const auto code = InChild(options.animation)) return *code;
  std::optional<Progress> reading(std::in_place, "reading " + converter::PathText(options.animation));
  reading->Step(0, 1);
  const Target target = options.model.empty() ? Target{} : ReadTarget(options.model);
  const JointMap map = options.map.empty() ? JointMap{} : ReadJointMap(options.map);
  const CharacterFile file = ReadCharacter(options.animation, false);
  const CharacterClip& clip = ChooseClip(file, options.clip);
  const Skeleton skeleton = SkeletonOf(file, map, target.joint_names, options.space);
  const Retarget retarget(file, skeleton, target.bind);
  const double fps = options.fps > 0 ? options.fps : target.tick_rate > 0 ? target.tick_rate : kDefaultRate;
  const ClipMatrices matrices = SampleClip(file, clip, skeleton, retarget, fps);
  reading.reset();
  const std::array<converter::SafeTensor, 1> tensors = {{{"joint_matrices",
                                                          converter::SafeType::kF32,
                                                          {matrices.frame_count, skeleton.nodes.size(), 4, 4},
                                                          std::as_bytes(std::span(matrices.values))}}};
  converter::WriteSafetensors(options.output, tensors,
                              {{"joint_names", JsonList(skeleton.joints)},
                               {"fps", NumberText(fps)},
                               {"clip", converter::PathText(options.animation.stem())},
                               {"kind", "dynamic"}});
  std::fprintf(stderr, "%s: %zu frames at %g Hz, %zu joints, from clip '%s' of a %s file with %g m in a unit\n",
               converter::PathText(options.output).c_str(), matrices.frame_count, fps, skeleton.nodes.size(),
               converter::PrintableText(clip.name).c_str(), file.format.c_str(), skeleton.space.metres_per_unit);
  if (retarget.farthest_metres() > kWorthAWord) {
    std::fprintf(stderr,
                 "note: at rest joint '%s' is %.0f mm from its place in the garment's bind pose; the garment learned "
                 "another body\n",
                 converter::PrintableText(skeleton.joints[retarget.farthest_joint()]).c_str(),
                 1e3 * retarget.farthest_metres());
  }
  return kExitGood;
}

}  // namespace

void AddPoses(CLI::App& app, int& exit_code) {
  auto options = std::make_shared<Options>();
  CLI::App* command = app.add_subcommand("poses", "Turn an animation (glTF, FBX, BVH) into a sequence");
  command->add_option("ANIMATION", options->animation, "a .glb, .gltf, .vrma, .fbx or .bvh file")->required();
  command->add_option("-o,--output", options->output, "the sequence to write (.safetensors)")->required();
  command->add_option("--map", options->map, "JSON: {\"joint of the garment\": \"node of the file\", ...}");
  command->add_option(
      "--model", options->model,
      "the joints to write: those of a .dcloth model, or of a bundle or character (.safetensors), which also say how\n"
      "each joint's axes lie in the bind pose. Default: every bone");
  command->add_option("--fps", options->fps, "frames per second. Default: the model's tick rate, or 30")
      ->check(NumberWithin(1, 1000));
  command->add_option("--clip", options->clip, "name or number (from 0) of the clip, if the file has several");
  AddSpaceOptions(command, &options->space);
  command->callback([options, &exit_code] { exit_code = Poses(*options); });
}

}  // namespace dcloth::tools
