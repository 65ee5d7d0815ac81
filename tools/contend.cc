#include "tools/contend.h"

#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "tools/machine.h"

namespace dcloth::tools {
namespace {

// Past the last-level cache, so that every round goes to memory.
constexpr size_t kMinimumCount = size_t{16} << 20;

}  // namespace

Contender::Contender(int core) {
  thread_ = std::thread([this, core] {
    PinThread(core);
    const size_t count = std::max<size_t>(kMinimumCount, LastLevelCacheBytes() / sizeof(float));
    std::vector<float> from(count, 1.0f), to(count, 0.5f);
    running_ = true;
    while (!stop_) {
      constexpr size_t kPiece = 65536;  // between looks at stop_
      for (size_t start = 0; start + kPiece <= count && !stop_; start += kPiece) {
        for (size_t i = start; i < start + kPiece; ++i) to[i] = to[i] * 0.9375f + from[i] * 0.0625f;
      }
      std::swap(from, to);
    }
  });
  while (!running_) std::this_thread::yield();
}

Contender::~Contender() {
  stop_ = true;
  thread_.join();
}

}  // namespace dcloth::tools
