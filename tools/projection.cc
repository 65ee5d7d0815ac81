#include "tools/projection.h"

#include <algorithm>
#include <cstdio>

namespace dcloth::tools {
namespace {

constexpr double kShare = 0.3, kLittleShare = 0.1;
constexpr double kInOrder = 0.5;

constexpr Device kDevices[] = {
    {"Steam Deck", "Zen 2", 3.5, 32, 2, 88, kShare, 1,
     "Valve: 3.5 GHz, LPDDR5-5500 of 128 bits; AMD: two 256-bit FMA units"},
    {"PS5-class", "Zen 2, halved FPU", 3.5, 16, 2, 448, kShare, 1,
     "Sony: 3.5 GHz, 448 GB/s; Chips and Cheese: half of Zen 2's floating-point units"},
    {"phone, big core", "Cortex-X1", 2.84, 32, 1, 51.2, kShare, 1,
     "Qualcomm (Snapdragon 888): 2.84 GHz, LPDDR5-6400 of 64 bits; Arm: four 128-bit units"},
    {"phone, little core", "Cortex-A55", 1.8, 8, 1, 51.2, kLittleShare, kInOrder,
     "Qualcomm: 1.8 GHz; vfpbench: one 128-bit multiply-add a cycle"},
    {"Switch-class", "Cortex-A57", 1.02, 8, 1, 25.6, kShare, 1,
     "1.02 GHz, LPDDR4-3200 of 64 bits; vfpbench: one 128-bit multiply-add a cycle"},
};

std::vector<std::string> Assumptions() {
  const auto text = [](const char* format, double value) {
    char out[200];
    std::snprintf(out, sizeof(out), format, value);
    return std::string(out);
  };
  return {"every byte of weights and state comes from memory: a game has emptied the caches",
          text("one core gets %.0f %% of the device's published memory bandwidth", 100 * kShare) +
              text(", a little core %.0f %%", 100 * kLittleShare) + text(", and none more than %g GB/s", kMostCoreGbs),
          "a kernel reaches the share of its limit that it reached on this machine in this run",
          text("an in-order core reaches %g of that", kInOrder),
          "int8 weights: two 16-bit multiply-adds for one of float32 on x86, one on Arm (no dot-product instructions)",
          "the published clock is held; nothing else runs on the core"};
}

double LimitMs(const KernelRow& row, const Device& device) {
  const double peak = device.gflops() * (row.work.int8 ? device.int8_factor : 1);
  const double flops = static_cast<double>(row.work.flops), bytes = static_cast<double>(row.work.bytes());
  return std::max(flops / peak, bytes / device.core_gbs()) * 1e-6;
}

// More than all of a limit is noise of the two measurements.
double Reached(const KernelRow& row, const Device& device) {
  return std::min(row.limit_ms() / row.ms->p50, 1.0) * device.reached_factor;
}

bool IsDrawn(const KernelRow& row) { return row.part >= converter::WorkPart::kSkinning; }

}  // namespace

double Device::core_gbs() const { return std::min(memory_gbs * core_share, kMostCoreGbs); }

std::span<const Device> ProjectedDevices() { return kDevices; }

std::vector<Projection> Project(std::span<const KernelRow> rows) {
  std::vector<Projection> projections;
  if (std::any_of(rows.begin(), rows.end(), [](const KernelRow& row) { return !row.ms; })) return projections;
  for (const Device& device : kDevices) {
    Projection projection{&device};
    for (const KernelRow& row : rows) {
      const double limit = LimitMs(row, device);
      if (!IsDrawn(row)) projection.limit_tick_ms += limit;
      (IsDrawn(row) ? projection.draw_ms : projection.tick_ms) += limit / Reached(row, device);
    }
    projections.push_back(projection);
  }
  return projections;
}

Json ProjectionJson(const Profile& profile) {
  Json json = {{"label", "projection, not a measurement"}, {"assumptions", Assumptions()}, {"devices", Json::array()}};
  for (const Projection& p : Project(KernelRows(profile))) {
    json["devices"].push_back({{"name", p.device->name},
                               {"core", p.device->core},
                               {"gflops", p.device->gflops()},
                               {"core_gbs", p.device->core_gbs()},
                               {"source", p.device->source},
                               {"limit_tick_ms", p.limit_tick_ms},
                               {"tick_ms", p.tick_ms},
                               {"draw_ms", p.draw_ms}});
  }
  return json;
}

void PrintProjection(const Profile& profile) {
  std::printf("\nPROJECTION, not a measurement: this model on devices that were not at hand\n");
  std::printf("  %-19s %-18s %9s %9s %12s %9s %9s\n", "device", "one core", "GFLOP/s", "GB/s", "limit, tick", "tick ms",
              "draw ms");
  for (const Projection& p : Project(KernelRows(profile))) {
    std::printf("  %-19s %-18s %9.1f %9.1f %12.3f %9.3f %9.3f\n", p.device->name, p.device->core, p.device->gflops(),
                p.device->core_gbs(), p.limit_tick_ms, p.tick_ms, p.draw_ms);
  }
  std::printf("assumed:\n");
  for (const std::string& assumption : Assumptions()) std::printf("  - %s\n", assumption.c_str());
  for (const Device& device : kDevices) std::printf("  - %s: %s\n", device.name, device.source);
}

}  // namespace dcloth::tools
