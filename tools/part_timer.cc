#include "tools/part_timer.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <numeric>
#include <vector>

namespace dcloth::tools {
namespace {

using converter::WorkPart;

// The pieces of a step, in the order in which the engine runs them.
std::vector<WorkPart> PartsOf(int step, uint32_t stages) {
  std::vector<WorkPart> parts;
  for (size_t p = 0; p < converter::kWorkPartCount; ++p) {
    const auto part = static_cast<WorkPart>(p);
    if (converter::StepOf(part) != step) continue;
    const bool skeleton = part >= WorkPart::kSkeletonInput && part <= WorkPart::kBasis;
    const bool mesh = part >= WorkPart::kBodyPoints && part <= WorkPart::kMeshCoefficients;
    if (skeleton && (stages & DCLOTH_STAGES_SKELETON) != DCLOTH_STAGES_SKELETON) continue;
    if (mesh && stages != DCLOTH_STAGES_MESH) continue;
    parts.push_back(part);
  }
  return parts;
}

// The engine runs the GRU's product and the graph layers in turns, both second of their step: [body points] then
// [layers, product] for each turn, [gates], [the last layer], and what follows. Each becomes one lap.
void JoinTurns(std::vector<uint64_t>* skeleton, std::vector<uint64_t>* mesh, size_t skeleton_pieces, size_t mesh_pieces) {
  if (skeleton->size() < skeleton_pieces || mesh->size() <= mesh_pieces) return;
  const size_t turns = skeleton->size() - skeleton_pieces + 1;
  if (mesh->size() - mesh_pieces != turns) return;
  const auto join = [](std::vector<uint64_t>* laps, size_t more) {
    const auto second = laps->begin() + 1, end = second + static_cast<std::ptrdiff_t>(more);
    *end += std::accumulate(second, end, uint64_t{0});
    laps->erase(second, end);
  };
  join(skeleton, turns - 1);
  join(mesh, turns);
}

}  // namespace

PartTimer::PartTimer(uint32_t stages) : stages_(stages) {
  timer_.struct_size = sizeof(timer_);
  timer_.now = Now;
  timer_.context = this;
}

uint64_t PartTimer::Now(void* self) {
  auto* timer = static_cast<PartTimer*>(self);
  const uint64_t now = NowNanoseconds();
  if (timer->count_ < kMost) {
    std::copy(std::begin(timer->timer_.elapsed), std::end(timer->timer_.elapsed),
              timer->before_[timer->count_].begin());
  }
  ++timer->count_;
  return now;
}

// What the engine adds after asking tells which step a piece belonged to; the first question of a call adds nothing.
TimedParts PartTimer::Take() {
  TimedParts taken;
  std::copy(std::begin(timer_.elapsed), std::end(timer_.elapsed), taken.steps.begin());
  taken.whole = count_ > 0 && count_ <= kMost;
  if (taken.whole) {
    before_[count_] = taken.steps;
    std::array<std::vector<uint64_t>, DCLOTH_STEP_COUNT> laps;
    for (size_t i = 0; i < count_; ++i) {
      for (size_t s = 0; s < laps.size(); ++s) {
        const uint64_t added = before_[i + 1][s] - before_[i][s];
        if (added != 0) laps[s].push_back(added);
      }
    }
    JoinTurns(&laps[DCLOTH_STEP_SKELETON], &laps[DCLOTH_STEP_MESH], PartsOf(DCLOTH_STEP_SKELETON, stages_).size(),
              PartsOf(DCLOTH_STEP_MESH, stages_).size());
    for (size_t s = 0; s < laps.size(); ++s) {
      const std::vector<WorkPart> parts = PartsOf(static_cast<int>(s), stages_);
      if (parts.empty() || laps[s].empty()) continue;
      if (parts.size() == 1) {  // a step that is one kernel, in one lap or two
        for (const uint64_t ns : laps[s]) taken.parts[static_cast<size_t>(parts[0])] += ns;
      } else if (parts.size() == laps[s].size()) {
        for (size_t p = 0; p < parts.size(); ++p) taken.parts[static_cast<size_t>(parts[p])] = laps[s][p];
      } else {
        taken.whole = false;
      }
    }
  }
  if (!taken.whole) taken.parts = {};
  std::fill(std::begin(timer_.elapsed), std::end(timer_.elapsed), 0);
  count_ = 0;
  return taken;
}

}  // namespace dcloth::tools
