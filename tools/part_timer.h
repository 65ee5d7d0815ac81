// Per-kernel times: the engine tells its timer every piece of a call by name.
#ifndef DCLOTH_TOOLS_PART_TIMER_H_
#define DCLOTH_TOOLS_PART_TIMER_H_

#include <array>
#include <cstdint>

#include "converter/model_work.h"
#include "dcloth/dcloth.h"
#include "tools/timing.h"

namespace dcloth::tools {

using PartTimes = std::array<uint64_t, converter::kWorkPartCount>;  // ns

struct TimedParts {
  StepTimes steps{};
  PartTimes parts{};  // of a tick that is spread over frames, what this one ran of each
};

class PartTimer {
 public:
  PartTimer();
  PartTimer(const PartTimer&) = delete;
  PartTimer& operator=(const PartTimer&) = delete;

  dcloth_timer* get() { return &timer_; }
  TimedParts Take();  // since the last call

 private:
  static void Piece(void* self, const char* name, uint64_t elapsed);

  dcloth_timer timer_{};
  PartTimes parts_{};
};

}  // namespace dcloth::tools

#endif  // DCLOTH_TOOLS_PART_TIMER_H_
