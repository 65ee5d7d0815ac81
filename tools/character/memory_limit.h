// How much memory a third-party reader may take: a few bytes of a file can claim gigabytes.
#ifndef DCLOTH_TOOLS_CHARACTER_MEMORY_LIMIT_H_
#define DCLOTH_TOOLS_CHARACTER_MEMORY_LIMIT_H_

#include <cstdint>

namespace dcloth::tools {

// Until it is lifted, on Linux, this process has the address space it had and an allowance that grows with the bytes
// that the reader is given; beyond it allocations fail. Never above the limit that held before. Elsewhere nothing.
class MemoryLimit {
 public:
  MemoryLimit();
  ~MemoryLimit() { Lift(); }
  MemoryLimit(const MemoryLimit&) = delete;

  void Allow(uint64_t file_bytes);  // for one more file
  void Lift();

  uint64_t allowance() const { return allowance_; }  // bytes

 private:
  void Apply(uint64_t bytes) const;

  uint64_t before_ = 0, taken_ = 0, allowance_ = 0;
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_CHARACTER_MEMORY_LIMIT_H_
