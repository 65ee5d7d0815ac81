#include "tools/machine.h"

#include <algorithm>
#include <fstream>

#include "converter/error.h"
#include "dcloth/dcloth.h"

#if defined(__linux__)
#include <sched.h>
#include <unistd.h>
#elif defined(_WIN32)
#ifndef NOMINMAX
#define NOMINMAX
#endif
#include <windows.h>
#endif

namespace dcloth::tools {
namespace {

// Ascending; empty where the system does not say.
std::vector<int> ReadAllowedCores() {
  std::vector<int> cores;
#if defined(__linux__)
  cpu_set_t set;
  CPU_ZERO(&set);
  if (sched_getaffinity(0, sizeof(set), &set) == 0) {
    for (int core = 0; core < CPU_SETSIZE; ++core) {
      if (CPU_ISSET(core, &set)) cores.push_back(core);
    }
  }
#elif defined(_WIN32)
  DWORD_PTR process = 0, system = 0;  // of this processor group, 64 cores at most
  if (GetProcessAffinityMask(GetCurrentProcess(), &process, &system)) {
    for (int core = 0; core < static_cast<int>(8 * sizeof(process)); ++core) {
      if (process >> core & 1) cores.push_back(core);
    }
  }
#endif
  return cores;
}

}  // namespace

std::string CpuName() {
#if defined(_WIN32)
  char name[256] = {};
  DWORD size = sizeof(name);
  if (RegGetValueA(HKEY_LOCAL_MACHINE, "HARDWARE\\DESCRIPTION\\System\\CentralProcessor\\0", "ProcessorNameString",
                   RRF_RT_REG_SZ, nullptr, name, &size) == ERROR_SUCCESS) {
    const std::string text = name;
    return text.substr(0, text.find_last_not_of(' ') + 1);
  }
#endif
  std::ifstream info("/proc/cpuinfo");
  for (std::string line; std::getline(info, line);) {
    const size_t colon = line.find(':');
    if (line.starts_with("model name") && colon + 2 < line.size()) return line.substr(colon + 2);
  }
  return "unknown CPU";
}

uint64_t LastLevelCacheBytes() {
  uint64_t bytes = 0;
  // What this core shares; the C library's figure was twelve times that on an EPYC of 32 MB a core complex.
  for (int level = 0; level < 8; ++level) {
    std::ifstream file("/sys/devices/system/cpu/cpu0/cache/index" + std::to_string(level) + "/size");
    uint64_t kibibytes = 0;
    if (file >> kibibytes) bytes = std::max(bytes, kibibytes << 10);
  }
  if (bytes > 0) return bytes;
#if defined(_WIN32)
  DWORD size = 0;
  GetLogicalProcessorInformation(nullptr, &size);
  std::vector<SYSTEM_LOGICAL_PROCESSOR_INFORMATION> found(size / sizeof(SYSTEM_LOGICAL_PROCESSOR_INFORMATION));
  if (!found.empty() && GetLogicalProcessorInformation(found.data(), &size)) {
    for (const SYSTEM_LOGICAL_PROCESSOR_INFORMATION& each : found) {
      if (each.Relationship == RelationCache) bytes = std::max(bytes, uint64_t{each.Cache.Size});
    }
  }
#endif
#if defined(_SC_LEVEL3_CACHE_SIZE)
  for (int name : {_SC_LEVEL2_CACHE_SIZE, _SC_LEVEL3_CACHE_SIZE, _SC_LEVEL4_CACHE_SIZE}) {
    const long value = sysconf(name);
    if (value > 0) bytes = std::max(bytes, static_cast<uint64_t>(value));
  }
#endif
  return bytes > 0 ? bytes : uint64_t{32} << 20;
}

// Asked once, before any thread is pinned: a pinned thread is allowed one core, and so is what it starts.
std::vector<int> AllowedCores() {
  static const std::vector<int> allowed = ReadAllowedCores();
  return allowed;
}

bool PinThread(int core) {
#if defined(__linux__) || defined(_WIN32)
  const std::vector<int> allowed = AllowedCores();
  if (std::find(allowed.begin(), allowed.end(), core) == allowed.end()) {
    std::string list;
    for (int c : allowed) list += (list.empty() ? "" : ", ") + std::to_string(c);
    throw converter::Error({.path = {},
                            .tensor = {},
                            .found = "core " + std::to_string(core),
                            .expected = "one of the cores " + list,
                            .mend = "pass --core with one of them"});
  }
#endif
#if defined(__linux__)
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(core, &set);
  return sched_setaffinity(0, sizeof(set), &set) == 0;
#elif defined(_WIN32)
  return SetThreadAffinityMask(GetCurrentThread(), DWORD_PTR{1} << core) != 0;
#else
  (void)core;
  return false;
#endif
}

void AddIsaOption(CLI::App* command) {
  const auto select = [](const std::string& name) {
    if (dcloth_isa_select(name.c_str()) == DCLOTH_OK) return;
    throw CLI::ValidationError("--isa", "found '" + name +
                                            "', which this CPU or build does not have; allowed: scalar, " +
                                            "reproducible, and what the CPU has, such as avx2 or neon");
  };
  command->add_option_function<std::string>("--isa", select,
                                            "run on these instructions, as avx2. Default: the best that the CPU has");
}

}  // namespace dcloth::tools
