// What rows of the displacement basis cost and buy: models of one bundle in several ranks and precisions, their ticks
// interleaved on one core with the caches emptied before each, and their distance to the fp32 model of full rank.
//
//   bench_rank skirt.safetensors walk.safetensors --calibrate run.safetensors --rank full --rank exact --rank 96
//
// SEQ is measured on and, unless it is named again under --calibrate, not seen by the reduction. Times are of one tick
// (network, skinning, normals) in ms; "blend" is its displacement step with the head.
#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "bench/frame/run.h"
#include "converter/convert.h"
#include "converter/rollout.h"
#include "tools/machine.h"
#include "tools/playback.h"
#include "tools/pose_track.h"
#include "tools/timing.h"

namespace dcloth::tools {
namespace {

using converter::ConvertOptions;
using converter::Precision;
using converter::RankMode;
using converter::Sequence;

converter::RankRequest RankOf(const std::string& text) {
  if (text == "full") return {RankMode::kFull};
  if (text == "exact") return {RankMode::kExact};
  return {RankMode::kFixed, static_cast<uint32_t>(std::stoul(text))};
}

// One model with its player and samples.
struct Variant {
  std::string name;
  converter::OpenModel model;
  converter::Trial trial;
  std::vector<PoseTrack> poses;
  std::unique_ptr<Player> player;
  std::vector<double> tick_ms, blend_ms;
};

void TickOnce(Variant* variant, size_t sequence, size_t frame, CacheEvictor* evictor) {
  StepTimer timer;
  const std::span<const float> pose = variant->poses[sequence].Frame(frame);
  variant->player->Cool(pose, evictor);
  const uint64_t start = NowNanoseconds();
  variant->player->Tick(pose, timer.get());
  variant->player->Skin(pose, 1);
  variant->tick_ms.push_back(static_cast<double>(NowNanoseconds() - start) * 1e-6);
  variant->blend_ms.push_back(static_cast<double>(timer.Take()[DCLOTH_STEP_DISPLACEMENT]) * 1e-6);
}

void Print(const std::vector<std::unique_ptr<Variant>>& variants) {
  std::printf("%-14s %5s %10s %9s %9s %9s %9s %9s %9s %9s\n", "variant", "rows", "bytes", "tick p50", "p99",
              "blend p50", "p99", "mm mean", "p99", "max");
  for (const std::unique_ptr<Variant>& v : variants) {
    const Percentiles tick = PercentilesOf(v->tick_ms), blend = PercentilesOf(v->blend_ms);
    const converter::PositionError& mm = v->trial.error.position_mm;
    std::printf("%-14s %5u %10llu %9.3f %9.3f %9.3f %9.3f %9.4f %9.4f %9.4f\n", v->name.c_str(), v->trial.rank,
                static_cast<unsigned long long>(v->trial.model_bytes), tick.p50, tick.p99, blend.p50, blend.p99,
                mm.mean, mm.p99, mm.max);
  }
}

std::vector<Sequence> Read(const std::vector<std::filesystem::path>& paths) {
  std::vector<Sequence> sequences;
  for (const std::filesystem::path& path : paths) sequences.push_back(converter::ReadSequence(path));
  return sequences;
}

}  // namespace

int Run(int argc, char** argv) {
  std::filesystem::path bundle_path;
  std::vector<std::filesystem::path> motion_paths, calibration_paths;
  std::vector<std::string> ranks = {"full", "exact"}, precisions = {"fp32", "fp16", "int8"};
  size_t ticks = 300;
  CLI::App app("Ranks of the displacement basis, cold and interleaved");
  app.add_option("BUNDLE", bundle_path)->required();
  app.add_option("SEQ", motion_paths)->required();
  app.add_option("--calibrate", calibration_paths)->allow_extra_args(false);
  app.add_option("--rank", ranks, "full, exact or a number; may be repeated")->allow_extra_args(false);
  app.add_option("--precision", precisions)->allow_extra_args(false);
  app.add_option("--ticks", ticks, "per variant")->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const converter::Bundle bundle = converter::ReadBundle(bundle_path);
  const std::vector<Sequence> motion = Read(motion_paths), calibration = Read(calibration_paths);
  std::vector<std::unique_ptr<Variant>> variants;
  for (const std::string& precision : precisions) {
    for (const std::string& rank : ranks) {
      ConvertOptions options;
      options.precision = converter::ParsePrecision(precision).value();
      options.rank = RankOf(rank);
      options.motion = motion;
      options.calibration = calibration;
      converter::ConvertResult result = converter::Convert(bundle, options);
      auto variant = std::make_unique<Variant>(Variant{precision + "/" + rank,
                                                       converter::OpenModel(std::move(result.bytes)),
                                                       result.report.trials.back(),
                                                       {},
                                                       nullptr,
                                                       {},
                                                       {}});
      for (const Sequence& s : motion) variant->poses.emplace_back(s, variant->model.joint_names());
      variant->player = std::make_unique<Player>(variant->model, variant->model.info().stages, bundle_path.string());
      variants.push_back(std::move(variant));
    }
  }
  CacheEvictor evictor;
  std::printf("%s, %s, cold\n", CpuName().c_str(), dcloth_isa_name());
  for (size_t done = 0, sequence = 0, frame = 0; done < ticks; ++done) {
    for (size_t v = 0; v < variants.size(); ++v)
      TickOnce(variants[(v + done) % variants.size()].get(), sequence, frame, &evictor);
    if (++frame == motion[sequence].frame_count) {
      frame = 0;
      sequence = (sequence + 1) % motion.size();
      for (const std::unique_ptr<Variant>& variant : variants) variant->player->Reset();
    }
  }
  Print(variants);
  return 0;
}

}  // namespace dcloth::tools
