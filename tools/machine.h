// What the machine is and where a thread runs on it.
#ifndef DCLOTH_TOOLS_MACHINE_H_
#define DCLOTH_TOOLS_MACHINE_H_

#include <cstdint>
#include <string>
#include <vector>

#include "tools/cli.h"

namespace dcloth::tools {

std::string CpuName();            // "AMD EPYC 7763", or "unknown CPU"
uint64_t LastLevelCacheBytes();   // 32 MiB where the system does not say
std::vector<int> AllowedCores();  // cores this process was started on, ascending; empty where the system does not say

// Keeps the calling thread on `core`. Throws converter::Error where the core is not allowed. False where the system has
// no such call.
bool PinThread(int core);

// --isa: measures as a machine with fewer instructions would. Refuses names that this CPU or build does not have.
void AddIsaOption(CLI::App* command);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_MACHINE_H_
