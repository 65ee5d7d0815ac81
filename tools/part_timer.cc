#include "tools/part_timer.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

namespace dcloth::tools {

PartTimer::PartTimer() {
  timer_.struct_size = sizeof(timer_);
  timer_.now = [](void*) { return NowNanoseconds(); };
  timer_.context = this;
  timer_.piece = Piece;
}

void PartTimer::Piece(void* self, const char* name, uint64_t elapsed) {
  converter::WorkPart part;
  if (!converter::FindWorkPart(name, &part)) return;
  static_cast<PartTimer*>(self)->parts_[static_cast<size_t>(part)] += elapsed;
}

TimedParts PartTimer::Take() {
  TimedParts taken;
  std::copy(std::begin(timer_.elapsed), std::end(timer_.elapsed), taken.steps.begin());
  taken.parts = parts_;
  std::fill(std::begin(timer_.elapsed), std::end(timer_.elapsed), 0);
  parts_ = {};
  return taken;
}

}  // namespace dcloth::tools
