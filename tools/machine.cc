#include "tools/machine.h"

#include <algorithm>
#include <fstream>

#include "converter/error.h"

#if defined(__linux__)
#include <sched.h>
#include <unistd.h>
#endif

namespace dcloth::tools {

std::string CpuName() {
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
  static const std::vector<int> allowed = [] {
    std::vector<int> cores;
#if defined(__linux__)
    cpu_set_t set;
    CPU_ZERO(&set);
    if (sched_getaffinity(0, sizeof(set), &set) == 0) {
      for (int core = 0; core < CPU_SETSIZE; ++core) {
        if (CPU_ISSET(core, &set)) cores.push_back(core);
      }
    }
#endif
    return cores;
  }();
  return allowed;
}

bool PinThread(int core) {
#if defined(__linux__)
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
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(core, &set);
  return sched_setaffinity(0, sizeof(set), &set) == 0;
#else
  (void)core;
  return false;
#endif
}

}  // namespace dcloth::tools
