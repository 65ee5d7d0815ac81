// What a character costs among many: cloths of one model, which share its weights, ticked and drawn in turn on a core.
//
//   bench_characters skirt.dcloth walk.safetensors --characters 1 --characters 8 --characters 64
//
// A sample is one tick (network, skinning, normals) of one character; all have their turn before the first ticks again.
// The instances' states, not the weights, are what more characters push out of the cache. JSON on stdout, times in ms.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <vector>

#include "bench/frame/run.h"
#include "converter/error.h"
#include "converter/file.h"
#include "tools/json_output.h"
#include "tools/machine.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

namespace dcloth::tools {
namespace {

void Require(dcloth_status status, const char* what) {
  if (status != DCLOTH_OK) throw std::runtime_error(std::string(what) + ": status " + std::to_string(status));
}

// A cloth with the buffers that its host draws from.
class Character {
 public:
  explicit Character(const converter::OpenModel& model)
      : memory_(dcloth_cloth_storage_size(model.model())),
        positions_(size_t{model.info().vertex_count} * 3),
        normals_(positions_.size()) {
    Require(dcloth_cloth_create(model.model(), memory_.data(), memory_.size(), &cloth_, nullptr), "create");
    output_.struct_size = sizeof(output_);
    output_.vertex_count = model.info().vertex_count;
    output_.positions = positions_.data();
    output_.normals = normals_.data();
    output_.position_stride_bytes = output_.normal_stride_bytes = 3 * sizeof(float);
  }

  void Tick(const dcloth_pose& pose, uint32_t stages) {
    Require(dcloth_cloth_tick(cloth_, &pose, stages, nullptr), "tick");
    Require(dcloth_cloth_skin(cloth_, &pose, 1, &output_, nullptr), "skin");
  }

 private:
  converter::AlignedBytes memory_;
  std::vector<float> positions_, normals_;
  dcloth_cloth* cloth_ = nullptr;
  dcloth_output output_{};
};

// Everyone is elsewhere in the sequence.
std::vector<double> Measure(const converter::OpenModel& model, const PoseTrack& poses, size_t count, size_t ticks) {
  std::vector<std::unique_ptr<Character>> characters;
  for (size_t i = 0; i < count; ++i) characters.push_back(std::make_unique<Character>(model));
  std::vector<double> samples;
  const size_t rounds = std::max<size_t>(3, ticks / count);
  for (size_t round = 0; round <= rounds; ++round) {
    for (size_t i = 0; i < count; ++i) {
      const std::span<const float> matrices = poses.Frame((round + 7 * i) % poses.frame_count());
      const uint64_t start = NowNanoseconds();
      characters[i]->Tick({sizeof(dcloth_pose), model.info().joint_count, matrices.data(), 0, 0}, model.info().stages);
      // The first round touches pages.
      if (round > 0) samples.push_back(static_cast<double>(NowNanoseconds() - start) * 1e-6);
    }
  }
  return samples;
}

}  // namespace

int Run(int argc, char** argv) {
  std::filesystem::path model_path, sequence_path;
  std::vector<size_t> counts = {1, 2, 4, 8, 16, 32, 64};
  size_t ticks = 400;
  CLI::App app("Characters that share one model");
  app.add_option("MODEL", model_path)->required();
  app.add_option("SEQ", sequence_path)->required();
  app.add_option("--characters", counts, "how many; may be repeated")
      ->allow_extra_args(false)
      ->check(CLI::PositiveNumber);
  app.add_option("--ticks", ticks, "per number of characters, over all of them")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  const converter::OpenModel model = OpenModelFile(model_path);
  const PoseTrack poses(converter::ReadSequence(sequence_path), model.joint_names());
  const std::vector<int> cores = AllowedCores();
  if (!cores.empty()) PinThread(cores.back());
  Json json = {{"cpu", CpuName()},
               {"isa", dcloth_isa_name()},
               {"model_bytes", model.bytes().size()},
               {"instance_bytes", model.instance_bytes()},
               {"rows", Json::array()}};
  for (const size_t count : counts) {
    const std::vector<double> samples = Measure(model, poses, count, ticks);
    json["rows"].push_back({{"characters", count}, {"ticks", samples.size()}, {"ms", ToJson(PercentilesOf(samples))}});
  }
  PrintJson(json);
  return 0;
}

}  // namespace dcloth::tools
