#include "tools/variant_runner.h"

#include <algorithm>

#include "converter/error.h"
#include "tools/evaluation.h"
#include "tools/playback.h"
#include "tools/report_scene.h"

namespace dcloth::tools {
namespace {

double MillisecondsSince(uint64_t start) { return static_cast<double>(NowNanoseconds() - start) * 1e-6; }

}  // namespace

std::vector<PoseTrack> PosesFor(const converter::OpenModel& model, std::span<const converter::Sequence> sequences) {
  std::vector<PoseTrack> poses;
  for (const converter::Sequence& s : sequences) poses.emplace_back(s, model.joint_names());
  return poses;
}

VariantRunner::VariantRunner(const converter::Bundle& bundle, const converter::OpenModel& model, uint32_t stages,
                             std::span<const converter::Sequence> sequences, std::span<const PoseTrack> poses,
                             uint32_t output_flags)
    : bundle_(bundle),
      model_(model),
      stages_(stages),
      output_flags_(output_flags),
      sequences_(sequences),
      poses_(poses) {}

VariantRunner::Positions VariantRunner::Play(size_t index, std::vector<double>* warm_ms, size_t held_from,
                                             size_t held_to) const {
  const size_t ticks = TickCount(bundle_, sequences_[index]), step = FramesPerTick(bundle_, sequences_[index]);
  Player player(model_, stages_, converter::PathText(sequences_[index].path), output_flags_);
  Positions out;
  std::vector<float>& positions = out.positions;
  positions.reserve(ticks * player.positions().size());
  player.Reset();
  for (size_t t = 0; t < ticks; ++t) {
    const std::span<const float> pose = poses_[index].Frame(t * step);
    player.SetWind(sequences_[index].FrameWind(t * step));
    const uint64_t start = NowNanoseconds();
    player.Tick(pose);
    player.Skin(pose, 1);
    if (warm_ms != nullptr) warm_ms->push_back(MillisecondsSince(start));
    positions.insert(positions.end(), player.positions().begin(), player.positions().end());
  }
  const std::span<const float> pose = poses_[index].Frame((ticks - 1) * step);
  std::vector<float> before;
  for (size_t t = 0; t < held_to; ++t) {
    player.Tick(pose);
    if (t + 1 < held_from) continue;  // nobody looks
    player.Skin(pose, 1);
    if (t >= held_from) out.held_mm += MeanDistanceMm(player.positions(), before);
    before.assign(player.positions().begin(), player.positions().end());
  }
  if (held_to > held_from) out.held_mm /= static_cast<double>(held_to - held_from);
  return out;
}

void VariantRunner::PlayCold(size_t index, size_t first, size_t last, CacheEvictor* evictor,
                             TickSamples* samples) const {
  const size_t ticks = TickCount(bundle_, sequences_[index]), step = FramesPerTick(bundle_, sequences_[index]);
  Player player(model_, stages_, converter::PathText(sequences_[index].path), output_flags_);
  StepTimer timer;
  player.Reset();
  for (size_t t = first; t < std::min(last, ticks); ++t) {
    const std::span<const float> pose = poses_[index].Frame(t * step);
    player.SetWind(sequences_[index].FrameWind(t * step));
    evictor->Evict();
    const uint64_t start = NowNanoseconds();
    player.Tick(pose, timer.get());
    player.Skin(pose, 1, timer.get());
    samples->cold_ms.push_back(MillisecondsSince(start));
    const StepTimes times = timer.Take();
    for (size_t s = 0; s < times.size(); ++s) {
      samples->stages_ms[s].push_back(static_cast<double>(times[s]) * 1e-6);
    }
  }
}

}  // namespace dcloth::tools
