#include "tools/profile_output.h"

#include <algorithm>
#include <cstdio>

#include "converter/error.h"
#include "converter/file.h"
#include "dcloth/dcloth.h"
#include "tools/machine.h"
#include "tools/profile_kernels.h"
#include "tools/projection.h"

namespace dcloth::tools {
namespace {

Percentiles Frames(const Profile& profile) {
  std::vector<double> samples;
  for (const ProfiledFrame& f : profile.frames) samples.push_back(FrameMs(f));
  return PercentilesOf(samples);
}

// A tick or, pipelined, a frame's part of one. Frames without any do not count.
Percentiles Ticks(const Profile& profile) {
  std::vector<double> samples;
  for (const ProfiledFrame& f : profile.frames) {
    if (f.ticks > 0) samples.push_back(static_cast<double>(f.tick_ns) * 1e-6 / (profile.pipelined ? 1 : f.ticks));
  }
  return PercentilesOf(samples);
}

// Over the frames in which the step ran.
Percentiles Step(const Profile& profile, size_t step) {
  std::vector<double> samples;
  for (const ProfiledFrame& f : profile.frames) {
    const uint64_t ns = f.tick_steps[step] + f.skin_steps[step];
    if (ns > 0) samples.push_back(static_cast<double>(ns) * 1e-6);
  }
  return PercentilesOf(samples);
}

void PrintRow(const char* name, const Percentiles& p) {
  std::printf("  %-14s %9.4f %9.4f %9.4f %9.4f\n", name, p.p50, p.p95, p.p99, p.max);
}

}  // namespace

double FrameMs(const ProfiledFrame& frame) { return static_cast<double>(frame.tick_ns + frame.skin_ns) * 1e-6; }

size_t Profile::missed_frames() const {
  if (budget_ms <= 0) return 0;
  return static_cast<size_t>(
      std::count_if(frames.begin(), frames.end(), [&](const ProfiledFrame& f) { return FrameMs(f) > budget_ms; }));
}

Json ProfileJson(const Profile& profile) {
  Json json = {{"version", dcloth_version()},
               {"model", profile.model},
               {"sequence", profile.sequence},
               {"garment", profile.garment},
               {"precision", profile.precision},
               {"model_bytes", profile.model_bytes},
               {"instance_bytes", profile.instance_bytes},
               {"cpu", CpuName()},
               {"isa", dcloth_isa_name()},
               {"core", profile.core < 0 ? Json(nullptr) : Json(profile.core)},
               {"fps", profile.fps},
               {"tick_rate", profile.tick_rate},
               {"stages", profile.stages},
               {"output", profile.output},
               {"contact", profile.contact},
               {"pipelined", profile.pipelined},
               {"cold", profile.cold},
               {"contend", profile.contend},
               {"frames", profile.frames.size()},
               {"interrupted_frames", profile.interrupted_ms.size()},
               {"interrupted_ms", ToJson(PercentilesOf(profile.interrupted_ms))},
               {"budget_ms", profile.budget_ms > 0 ? Json(profile.budget_ms) : Json(nullptr)},
               {"missed_frames", profile.budget_ms > 0 ? Json(profile.missed_frames()) : Json(nullptr)},
               {"frame_ms", ToJson(Frames(profile))},
               {"tick_ms", ToJson(Ticks(profile))},
               {"stages_ms", Json::object()},
               {"truth", ToJson(profile.error)},
               {"histogram", HistogramJson(profile)},
               {"machine", MachineJson(profile)},
               {"kernels", KernelsJson(profile)},
               {"projection", profile.project ? ProjectionJson(profile) : Json(nullptr)}};
  for (size_t s = 0; s < kStepNames.size(); ++s) json["stages_ms"][kStepNames[s]] = ToJson(Step(profile, s));
  return json;
}

void PrintProfile(const Profile& profile) {
  std::printf("%s, %s, %.3f MB, %.1f KiB per instance\n", converter::PrintableText(profile.garment).c_str(),
              converter::PrintableText(profile.precision).c_str(), static_cast<double>(profile.model_bytes) / 1e6,
              static_cast<double>(profile.instance_bytes) / 1024);
  std::printf("%s, %s, core %s, %s caches%s, %zu frames at %g Hz, ticks at %g Hz\n", CpuName().c_str(),
              dcloth_isa_name(), profile.core < 0 ? "not pinned" : std::to_string(profile.core).c_str(),
              profile.cold ? "cold" : "warm", profile.contend ? ", a busy neighbour" : "", profile.frames.size(),
              profile.fps, profile.tick_rate);
  std::string drawn;
  for (const std::string& what : profile.output) drawn += (drawn.empty() ? "" : ", ") + what;
  std::printf("stages up to %s, draws %s%s\n\n", profile.stages.c_str(), drawn.c_str(),
              profile.contact ? ", kept outside of the body" : "");
  std::printf("  %-14s %9s %9s %9s %9s\n", "ms", "p50", "p95", "p99", "max");
  PrintRow("frame", Frames(profile));
  PrintRow(profile.pipelined ? "part of tick" : "tick", Ticks(profile));
  for (size_t s = 0; s < kStepNames.size(); ++s)
    PrintRow((std::string("  ") + kStepNames[s]).c_str(), Step(profile, s));
  if (!profile.interrupted_ms.empty()) {
    std::printf("  and %zu frames that the system interrupted, of up to %.4f ms; they count nowhere\n",
                profile.interrupted_ms.size(), PercentilesOf(profile.interrupted_ms).max);
  }
  PrintKernels(profile);
  PrintHistogram(profile);
  if (profile.error.frame_count > 0) {
    const converter::PositionError& e = profile.error.position_mm;
    std::printf("\nerror to the simulation, as drawn: mean %.3f +- %.3f, p99 %.2f, max %.2f mm; normals %.2f deg\n",
                e.mean, e.std, e.p99, e.max, profile.error.normal_deg.mean);
  } else {
    std::printf("\nerror: the sequence has no truth at the frames drawn\n");
  }
  if (profile.project) PrintProjection(profile);
  if (profile.budget_ms > 0) {
    std::printf("budget %.3f ms: %zu of %zu frames missed\n", profile.budget_ms, profile.missed_frames(),
                profile.frames.size());
  }
}

void WriteTrace(const std::filesystem::path& path, const Profile& profile) {
  Json events = Json::array();
  const uint64_t origin = profile.frames.empty() ? 0 : profile.frames.front().start_ns;
  const auto add = [&](const char* name, uint64_t start_ns, uint64_t length_ns, size_t frame) {
    events.push_back({{"name", name},
                      {"ph", "X"},
                      {"pid", 1},
                      {"tid", 1},
                      {"ts", static_cast<double>(start_ns - origin) * 1e-3},
                      {"dur", static_cast<double>(length_ns) * 1e-3},
                      {"args", {{"frame", frame}}}});
  };
  // Kernels of a step lie inside it, where it has more than one.
  const auto add_kernels = [&](const PartTimes& parts, size_t step, uint64_t start_ns, size_t frame) {
    for (size_t p = 0; p < parts.size(); ++p) {
      const auto part = static_cast<converter::WorkPart>(p);
      const bool alone = part == converter::WorkPart::kStatic || part >= converter::WorkPart::kSkinning;
      if (parts[p] == 0 || alone || converter::StepOf(part) != static_cast<int>(step)) continue;
      add(converter::WorkPartName(part), start_ns, parts[p], frame);
      start_ns += parts[p];
    }
  };
  const auto add_steps = [&](const StepTimes& steps, const PartTimes* parts, uint64_t start_ns, size_t frame) {
    for (size_t s = 0; s < steps.size(); ++s) {
      if (steps[s] == 0) continue;
      add(kStepNames[s], start_ns, steps[s], frame);
      if (parts != nullptr) add_kernels(*parts, s, start_ns, frame);
      start_ns += steps[s];
    }
  };
  for (size_t i = 0; i < profile.frames.size(); ++i) {
    const ProfiledFrame& f = profile.frames[i];
    add("frame", f.start_ns, f.tick_ns + f.skin_ns, i);
    if (f.ticks > 0) add("tick", f.start_ns, f.tick_ns, i);
    add_steps(f.tick_steps, &f.parts, f.start_ns, i);
    add("skin", f.start_ns + f.tick_ns, f.skin_ns, i);
    add_steps(f.skin_steps, nullptr, f.start_ns + f.tick_ns, i);
  }
  const std::string text = DumpJson({{"traceEvents", events}, {"displayTimeUnit", "ms"}}, -1);
  converter::WriteFileAtomically(path, std::as_bytes(std::span(text.data(), text.size())));
}

}  // namespace dcloth::tools
