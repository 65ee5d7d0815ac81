#include "tools/character/memory_limit.h"

#if defined(__linux__)
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#endif

namespace dcloth::tools {

#if defined(__linux__)
namespace {

// The largest appetite seen is 52 bytes a byte, for a BVH file of 70,000 joints.
constexpr uint64_t kAllowance = uint64_t{256} << 20, kPerFileByte = 128;

uint64_t AddressSpaceTaken() {
  uint64_t pages = 0;
  std::ifstream("/proc/self/statm") >> pages;  // 0 where there is no such file
  return pages * static_cast<uint64_t>(sysconf(_SC_PAGESIZE));
}

}  // namespace

MemoryLimit::MemoryLimit() : taken_(AddressSpaceTaken()), allowance_(kAllowance) {
  rlimit limit;
  if (taken_ == 0 || getrlimit(RLIMIT_AS, &limit) != 0) return;
  before_ = limit.rlim_cur;
  Apply(taken_ + allowance_);
}

void MemoryLimit::Lift() { Apply(before_); }

void MemoryLimit::Allow(uint64_t file_bytes) {
  allowance_ += kPerFileByte * std::min(file_bytes, uint64_t{1} << 40);
  Apply(taken_ + allowance_);
}

void MemoryLimit::Apply(uint64_t bytes) const {
  rlimit limit;
  if (before_ == 0 || getrlimit(RLIMIT_AS, &limit) != 0) return;
  limit.rlim_cur = std::min<uint64_t>(bytes, before_);
  setrlimit(RLIMIT_AS, &limit);
}

#else

MemoryLimit::MemoryLimit() = default;
void MemoryLimit::Lift() {}
void MemoryLimit::Allow(uint64_t) {}
void MemoryLimit::Apply(uint64_t) const {}

#endif

}  // namespace dcloth::tools
