// What a frame would cost on devices that are not at hand: counted operations and bytes over published figures of their
// cores. A projection, never a measurement; every assumption is part of the answer.
#ifndef DCLOTH_TOOLS_PROJECTION_H_
#define DCLOTH_TOOLS_PROJECTION_H_

#include <span>
#include <string>
#include <vector>

#include "tools/profile_kernels.h"

namespace dcloth::tools {

struct Device {
  const char* name;
  const char* core;
  double ghz;             // published
  int flops_per_cycle;    // float32 multiply-adds of one core, two operations each; published or measured by others
  int int8_factor;        // 16-bit multiply-adds over float32 ones: 2 for x86's pmaddwd, 1 for NEON's smlal
  double memory_gbs;      // of the whole device, published
  double core_share;      // assumed: what one core gets of it
  double reached_factor;  // assumed: what it reaches of the share of the limit that this machine reached
  const char* source;

  double gflops() const { return ghz * flops_per_cycle; }
  double core_gbs() const;  // memory_gbs * core_share, at most kMostCoreGbs
};

// Assumed: no core of these reads memory faster, however wide the memory is.
constexpr double kMostCoreGbs = 20;

std::span<const Device> ProjectedDevices();

struct Projection {
  const Device* device;
  double limit_tick_ms = 0;  // all kernels of a tick at the device's peak and with every byte from memory
  double tick_ms = 0;        // each kernel at the share of its limit that it reached here
  double draw_ms = 0;        // skinning and normals, likewise
};

// `rows` are of a profile whose kernels were timed; empty otherwise.
std::vector<Projection> Project(std::span<const KernelRow> rows);

Json ProjectionJson(const Profile& profile);
void PrintProjection(const Profile& profile);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PROJECTION_H_
