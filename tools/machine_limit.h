// What one core of this machine can do at most: measured, so that a stage's time can be put beside it.
#ifndef DCLOTH_TOOLS_MACHINE_LIMIT_H_
#define DCLOTH_TOOLS_MACHINE_LIMIT_H_

#include <cstdint>

namespace dcloth::tools {

struct MachineLimit {
  double gflops = 0;        // float32 multiply-adds from registers, two operations each
  const char* unit = "";    // what they were measured with: "AVX2 FMA", "128-bit multiply and add"
  uint64_t read_bytes = 0;  // the working set that read_gbs is for
  double read_gbs = 0;      // reading it again and again, from whatever cache holds it
  double memory_gbs = 0;    // reading more than twice the last-level cache
};

// Many short runs on the calling thread, about a tenth of a second in all, of which the best count: other work on the
// machine can only lower them.
MachineLimit MeasureLimit(uint64_t working_set_bytes);

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_MACHINE_LIMIT_H_
